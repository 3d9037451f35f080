//! A bitmap font of 5x9 pixels, drawn for this project: seven rows above the baseline and two below.

/// Pixels across a glyph.
pub(super) const WIDTH: usize = 5;
/// Pixels down a glyph.
pub(super) const HEIGHT: usize = 9;

/// Whether the pixel at column `x` and row `y` of a character is ink. Characters that are not drawn are blank.
pub(super) fn ink(character: char, x: usize, y: usize) -> bool {
    let place = SHEETS.iter().find_map(|(characters, rows)| Some((characters.find(character)?, rows)));
    // Glyphs stand a column apart. The characters are all ASCII: bytes count them.
    place.is_some_and(|(i, rows)| rows[y].as_bytes().get(i * (WIDTH + 1) + x) == Some(&b'#'))
}

/// Characters, and their glyphs side by side.
const SHEETS: &[(&str, [&str; HEIGHT])] = &[
    (
        "ABCDEFGHIJKLM",
        [
            " ###  ####   ###  ####  ##### #####  ###  #   # #####     # #   # #     #   #",
            "#   # #   # #   # #   # #     #     #   # #   #   #       # #  #  #     ## ##",
            "#   # #   # #     #   # #     #     #     #   #   #       # # #   #     # # #",
            "##### ####  #     #   # ####  ####  # ### #####   #       # ##    #     # # #",
            "#   # #   # #     #   # #     #     #   # #   #   #       # # #   #     #   #",
            "#   # #   # #   # #   # #     #     #   # #   #   #   #   # #  #  #     #   #",
            "#   # ####   ###  ####  ##### #      ###  #   # #####  ###  #   # ##### #   #",
            "",
            "",
        ],
    ),
    (
        "NOPQRSTUVWXYZ",
        [
            "#   #  ###  ####   ###  ####   #### ##### #   # #   # #   # #   # #   # #####",
            "##  # #   # #   # #   # #   # #       #   #   # #   # #   # #   # #   #     #",
            "# # # #   # #   # #   # #   # #       #   #   # #   # #   #  # #   # #     # ",
            "#  ## #   # ####  #   # ####   ###    #   #   # #   # # # #   #     #     #  ",
            "#   # #   # #     # # # # #       #   #   #   # #   # # # #  # #    #    #   ",
            "#   # #   # #     #  #  #  #      #   #   #   #  # #  ## ## #   #   #   #    ",
            "#   #  ###  #      ## # #   # ####    #    ###    #   #   # #   #   #   #####",
            "",
            "",
        ],
    ),
    (
        "abcdefghijklm",
        [
            "      #               #         ##        #       #      #  #     ##         ",
            "      #               #        #          #                 #      #         ",
            " ###  # ##   ###   ## #  ###  ###    #### # ##   ##     ##  #  #   #    ## # ",
            "    # ##  # #     #  ## #   #  #    #   # ##  #   #      #  # #    #    # # #",
            " #### #   # #     #   # #####  #    #   # #   #   #      #  ##     #    # # #",
            "#   # ##  # #     #  ## #      #    #   # #   #   #      #  # #    #    # # #",
            " #### # ##   ###   ## #  ###   #     #### #   #  ###     #  #  #  ###   # # #",
            "                                        #             #  #                   ",
            "                                     ###               ##                    ",
        ],
    ),
    (
        "nopqrstuvwxyz",
        [
            "                                     #                                       ",
            "                                     #                                       ",
            "# ##   ###  # ##   ## # # ##   #### ###   #   # #   # #   # #   # #   # #####",
            "##  # #   # ##  # #  ## ##  # #      #    #   # #   # #   #  # #  #   #    # ",
            "#   # #   # #   # #   # #      ###   #    #   # #   # # # #   #   #   #   #  ",
            "#   # #   # ##  # #  ## #         #  #    #  ##  # #  # # #  # #  #  ##  #   ",
            "#   #  ###  # ##   ## # #     ####    ##   ## #   #    # #  #   #  ## # #####",
            "            #         #                                               #      ",
            "            #         #                                            ###       ",
        ],
    ),
    (
        "0123456789.,;:!?-'",
        [
            " ###    #    ###  #####    #  #####   ##  #####  ###   ###                            #    ###          #  ",
            "#   #  ##   #   #    #    ##  #      #        # #   # #   #                           #   #   #         #  ",
            "#  ##   #       #   #    # #  ####  #        #  #   # #   #              ##    ##     #       #        #   ",
            "# # #   #      #   ###  #  #      # ####    #    ###   ####              ##    ##     #      #   ###       ",
            "##  #   #     #       # #####     # #   #  #    #   #     #                           #     #              ",
            "#   #   #    #    #   #    #  #   # #   #  #    #   #    #  ##    ##     ##    ##                          ",
            " ###   ###  #####  ###     #   ###   ###   #     ###   ##   ##    ##     ##    ##     #     #              ",
            "                                                                   #      #                                ",
            "                                                                  #      #                                 ",
        ],
    ),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_character_is_drawn_and_unlike_every_other() {
        let bitmap = |c: char| -> Vec<bool> { (0..WIDTH * HEIGHT).map(|i| ink(c, i % WIDTH, i / WIDTH)).collect() };
        let all: Vec<char> = SHEETS.iter().flat_map(|(characters, _)| characters.chars()).collect();
        for (i, &a) in all.iter().enumerate() {
            assert!(bitmap(a).contains(&true), "{a} is blank");
            assert!(all[..i].iter().all(|&b| bitmap(a) != bitmap(b)), "{a} looks like another");
        }
        assert!(!bitmap(' ').contains(&true));
    }
}
