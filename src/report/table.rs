//! Text tables: the first column to the left, numbers to the right.

use std::fmt;

/// Rows under a header. Rows may be shorter than the header.
#[derive(Debug, Clone, Default)]
pub struct Table {
    rows: Vec<Vec<String>>,
    left: bool,
}

impl Table {
    /// A table with these column titles.
    pub fn new<S: Into<String>>(titles: impl IntoIterator<Item = S>) -> Self {
        Self { rows: vec![titles.into_iter().map(Into::into).collect()], left: false }
    }

    /// The same with all columns to the left, for words.
    pub fn left(self) -> Self {
        Self { left: true, ..self }
    }

    /// Adds a row below the others.
    pub fn row<S: Into<String>>(&mut self, cells: impl IntoIterator<Item = S>) {
        self.rows.push(cells.into_iter().map(Into::into).collect());
    }

    fn widths(&self) -> Vec<usize> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |c: usize| self.rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max();
        (0..columns).map(|c| width(c).unwrap_or(0)).collect()
    }
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let widths = self.widths();
        for row in &self.rows {
            let mut line = String::new();
            for (column, (cell, width)) in row.iter().zip(&widths).enumerate() {
                let gap = if column == 0 { "" } else { "  " };
                let left = self.left || column == 0;
                line += &if left { format!("{gap}{cell:<width$}") } else { format!("{gap}{cell:>width$}") };
            }
            writeln!(f, "{}", line.trim_end())?;
        }
        Ok(())
    }
}

/// `n` with a comma between thousands.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|g| std::str::from_utf8(g).ok()).collect();
    groups.join(",")
}

/// Bytes in the largest binary unit that keeps the number above 1, to a tenth: `640 B`, `1.5 MiB`.
pub fn bytes(n: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB", "TiB"];
    // A value that would be rounded to 1024.0 belongs to the next unit.
    let power = (0..units.len()).rev().find(|&p| n as f64 / 1024f64.powi(p as i32) >= 0.99995 || p == 0).unwrap_or(0);
    if power == 0 { format!("{n} B") } else { format!("{:.1} {}", n as f64 / 1024f64.powi(power as i32), units[power]) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_line_up() {
        let mut table = Table::new(["method", "ms"]);
        table.row(["stable:1", "10.25"]);
        table.row(["größe", "-"]);
        table.row(["short"]);
        assert_eq!(table.to_string(), "method       ms\nstable:1  10.25\ngröße         -\nshort\n");
        assert_eq!(table.left().to_string(), "method    ms\nstable:1  10.25\ngröße     -\nshort\n");
    }

    #[test]
    fn thousands_are_grouped() {
        assert_eq!([0, 999, 1000, 1_234_567].map(grouped), ["0", "999", "1,000", "1,234,567"]);
    }

    #[test]
    fn bytes_take_the_largest_unit() {
        assert_eq!([0, 1023, 1024, 1536 * 1024].map(bytes), ["0 B", "1023 B", "1.0 KiB", "1.5 MiB"]);
        assert_eq!(bytes(1024 * 1024 - 1), "1.0 MiB");
    }
}
