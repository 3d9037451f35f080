//! Known answers in f64, without any tree, and the bounds within which the f32 walk has to agree with them.
//!
//! The reference takes the instance's f32 transform as exact. What it is asked is not "which triangle is nearest" (of two
//! triangles that meet, rounding decides) but which triangles a ray *surely* hits, and at which t within which bound:
//! [`disagreement`] then states what is wrong with an answer, if anything is.

use glam::{DVec2, DVec3, Vec3};

use super::{Intersection, Query, World};
use crate::accel::is_placed;
use crate::shaders::Instance;

/// Roundoff of f32.
const U: f64 = 1.0 / 16_777_216.0;

/// A ray against a triangle, in exact arithmetic for all that f32 is concerned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exact {
    /// Where the ray meets the triangle's plane.
    pub t: f64,
    /// Barycentric weights there, of vertex 0, 1 and 2; negative outside the triangle.
    pub weights: [f64; 3],
    /// What an f32 t may differ by; infinite for a plane seen edge-on.
    pub t_bound: f64,
    /// What f32 weights may differ by; infinite for a triangle seen edge-on.
    pub weight_bound: f64,
}

/// A ray in object space, with the bounds on what f32 makes of it.
struct ObjectRay {
    origin: DVec3,
    direction: DVec3,
    origin_bound: DVec3,
    direction_bound: DVec3,
}

impl ObjectRay {
    /// `o' = R o + r` and `d' = R d`: 4 u and 3 u of the magnitudes (ray.glsl).
    fn new(instance: &Instance, query: &Query) -> Self {
        let rows = instance.to_object.map(|row| row.map(f64::from));
        let (o, d) = (query.origin.as_dvec3(), query.direction.as_dvec3());
        let linear = |v: DVec3| DVec3::from_array(rows.map(|r| DVec3::new(r[0], r[1], r[2]).dot(v)));
        let sizes = |v: DVec3| DVec3::from_array(rows.map(|r| DVec3::new(r[0], r[1], r[2]).abs().dot(v.abs())));
        let translation = DVec3::from_array(rows.map(|r| r[3]));
        Self {
            origin: linear(o) + translation,
            direction: linear(d),
            origin_bound: 4.0 * U * (sizes(o) + translation.abs()),
            direction_bound: 3.0 * U * sizes(d),
        }
    }
}

/// Intersects a triangle of an instance. `None` if its plane has no normal or is parallel to the ray, exactly.
pub fn intersect(instance: &Instance, corners: [Vec3; 3], query: &Query) -> Option<Exact> {
    let ray = ObjectRay::new(instance, query);
    let [a, b, c] = corners.map(|p| p.as_dvec3() - ray.origin);
    let (e1, e2) = (b - a, c - a);
    let n = e1.cross(e2);
    let slope = n.dot(ray.direction);
    if slope == 0.0 {
        return None;
    }
    let t = n.dot(a) / slope;
    let weight = |p: DVec3, q: DVec3| ray.direction.dot(p.cross(q)) / slope;
    Some(Exact {
        t,
        weights: [weight(b, c), weight(c, a), weight(a, b)],
        t_bound: t_bound(&ray, [a, b, c], slope, t),
        weight_bound: weight_bound(&ray, [a, b, c]),
    })
}

/// The normal e1 x e2 is exact to 6 u of N = |products|, the vector to vertex 0 to 1 u of itself and what the origin is
/// uncertain by, sums to 3 u; then t = height / slope with a reciprocal of 5 u and a product of 1 u. t is last clamped to
/// the range of the vertices, each exact to 1 u (difference), 6 u (reciprocal) and 1 u (product).
fn t_bound(ray: &ObjectRay, [a, b, c]: [DVec3; 3], slope: f64, t: f64) -> f64 {
    let (e1, e2) = ((b - a).abs(), (c - a).abs());
    let products = DVec3::new(e1.y * e2.z + e1.z * e2.y, e1.z * e2.x + e1.x * e2.z, e1.x * e2.y + e1.y * e2.x);
    let height_bound = products.dot(10.0 * U * a.abs() + ray.origin_bound);
    let slope_bound = products.dot(9.0 * U * ray.direction.abs() + ray.direction_bound);
    let slope = slope.abs();
    if slope_bound * 2.0 >= slope {
        return f64::INFINITY;
    }
    let plane = (height_bound + t.abs() * slope_bound) / (slope - slope_bound) + 6.0 * U * t.abs();
    let farthest = [a, b, c].map(|p| p.abs().max_element()).into_iter().fold(0.0, f64::max);
    let main = ray.direction.abs().max_element();
    let range = (8.0 * U * farthest + ray.origin_bound.max_element()) / main
        + farthest / main * ray.direction_bound.max_element() / main;
    // Second order: products of the roundoffs above.
    (plane + range) * (1.0 + 1e-5)
}

/// The vertices, sheared along the main axis of the ray, are exact to P: what the origin is uncertain by, along the axis
/// and across it; 1 u for the difference, 7 u for the shear factor, 2 u for product and sum; and the direction's error.
/// Moving the corners of a triangle by P moves weights by 2 P longest / (2 area) each for the point and for the corners, and an edge
/// function is a difference of two rounded products besides (3 u of their magnitudes, in each weight and in their sum).
fn weight_bound(ray: &ObjectRay, corners: [DVec3; 3]) -> f64 {
    let axis = ray.direction.abs().max_position();
    let (x, y) = ((axis + 1) % 3, (axis + 2) % 3);
    let d = ray.direction;
    let sheared = corners.map(|p| DVec2::new(p[x] - d[x] / d[axis] * p[axis], p[y] - d[y] / d[axis] * p[axis]));
    let [a, b, c] = sheared;
    let area2 = (b - a).perp_dot(c - a).abs();
    let farthest = corners.map(|p| p.abs().max_element()).into_iter().fold(0.0, f64::max);
    let moved = 2.0 * ray.origin_bound.max_element()
        + 11.0 * U * farthest
        + 2.0 * farthest * ray.direction_bound.max_element() / d[axis].abs();
    let across = [a, b, c].map(DVec2::length).into_iter().fold(0.0, f64::max) + moved;
    let longest = [b - a, c - b, a - c].map(DVec2::length).into_iter().fold(0.0, f64::max) + moved;
    let bound = (8.0 * moved * longest + 24.0 * U * across * across) / area2;
    // Where the area itself is uncertain, so is everything.
    if 4.0 * moved * longest >= area2 { f64::INFINITY } else { bound }
}

/// What is wrong with `found` as the closest hit of a ray, in words; `None` if nothing is. Opaque surfaces only.
pub fn disagreement(world: &World, query: &Query, found: Option<&Intersection>) -> Option<String> {
    if let Some(hit) = found {
        let exact = intersect(&world.instances[hit.instance as usize], world.geometry.corners(hit.primitive), query);
        let problem = exact.map_or_else(|| Some("hits an edge-on triangle".to_owned()), |e| wrong_hit(&e, hit));
        if problem.is_some() {
            return problem;
        }
    }
    let end = found.map_or(query.tmax, |hit| hit.t);
    for_each_triangle(world, |instance, primitive| {
        let exact = intersect(&world.instances[instance as usize], world.geometry.corners(primitive), query)?;
        let missed = is_sure(&exact) && exact.t + exact.t_bound < f64::from(end);
        missed.then(|| format!("misses triangle {primitive} of instance {instance} before t = {end}: {exact:?}"))
    })
}

/// Whether an f32 test has to find this hit.
pub fn is_sure(exact: &Exact) -> bool {
    exact.weights.iter().all(|&w| w > exact.weight_bound) && exact.t > exact.t_bound
}

fn wrong_hit(exact: &Exact, hit: &Intersection) -> Option<String> {
    let [_, u, v] = exact.weights;
    let weights = [(u, hit.u), (v, hit.v)];
    let t_off = (exact.t - f64::from(hit.t)).abs();
    let inside = exact.weights.iter().all(|&w| w >= -exact.weight_bound);
    let weights_fit = weights.iter().all(|&(w, f)| (w - f64::from(f)).abs() <= exact.weight_bound);
    let right = inside && weights_fit && t_off <= exact.t_bound;
    (!right).then(|| format!("{hit:?} against {exact:?}"))
}

fn for_each_triangle<T>(world: &World, visit: impl Fn(u32, u32) -> Option<T>) -> Option<T> {
    let instances = world.instances.iter().zip(&world.geometry.instance_meshes).zip(0..);
    instances.filter(|((instance, _), _)| is_placed(instance)).find_map(|((_, &mesh), i)| {
        let record = &world.geometry.meshes[mesh as usize];
        (record.first_triangle..record.first_triangle + record.triangle_count).find_map(|p| visit(i, p))
    })
}
