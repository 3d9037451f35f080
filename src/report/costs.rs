//! What rays cost, as a table: a row a kind of ray.

use super::statistics::ratio;
use super::table::{Table, grouped};
use crate::stats::RayCosts;

/// Everything that was counted, if anything was.
pub fn sum(counted: impl IntoIterator<Item = Option<RayCosts>>) -> Option<RayCosts> {
    counted.into_iter().flatten().reduce(|a, b| a.plus(&b))
}

/// Of each of these, named, what its rays in so many frames cost. Kinds without a ray are left out.
pub fn table(counted: impl IntoIterator<Item = (String, RayCosts)>, frames: u64) -> Table {
    let titles = ["", "rays", "rays/frame", "nodes/ray", "triangles/ray", "busy threads", "triangles/packet"];
    let mut table = Table::new(titles);
    let a_frame = |count: u64| grouped((count as f64 / frames.max(1) as f64).round() as u64);
    for (name, costs) in counted {
        for (kind, cost) in costs.kinds().into_iter().filter(|(_, cost)| cost.rays > 0) {
            table.row([
                name.clone(),
                kind.to_owned(),
                a_frame(cost.rays),
                format!("{:.2}", cost.nodes_per_ray()),
                format!("{:.2}", cost.triangles_per_ray()),
                format!("{:.1} %", 100.0 * cost.utilisation()),
                format!("{:.1}", cost.triangles_per_packet()),
            ]);
        }
        if costs.march_steps > 0 {
            let rays = ratio(costs.march.rays as f64, costs.march_steps as f64);
            let steps = [name, "march steps".to_owned(), a_frame(costs.march_steps)];
            table.row(steps.into_iter().chain([format!("{rays:.2} rays/step")]));
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::RayCost;

    #[test]
    fn a_row_a_kind_that_has_rays() {
        let camera = RayCost { rays: 200, nodes: 1000, triangles: 300, held: 2000, packets: 10, packet_triangles: 55 };
        let costs = RayCosts { camera, march_steps: 40, ..RayCosts::default() };
        let both = sum([Some(costs), None, Some(costs)]).unwrap();
        assert_eq!((both.camera.rays, both.march_steps), (400, 80));
        let text = table([("stable".to_owned(), both)], 2).to_string();
        let lines: Vec<Vec<&str>> = text.lines().map(|l| l.split_whitespace().collect()).collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert_eq!(lines[1], ["stable", "camera", "200", "5.00", "1.50", "50.0", "%", "5.5"]);
        assert_eq!(lines[2][..4], ["stable", "march", "steps", "40"]);
        assert_eq!(sum([None]), None);
    }
}
