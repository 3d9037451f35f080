//! Meshes that several scenes use. All wind counter-clockwise as seen from where their normals point.

use crate::scene::Mesh;
use glam::{DVec2, DVec3, Vec2, Vec3};
use std::f64::consts::{PI, TAU};

/// A vertex with position, normal and texture coordinates.
pub(super) type Vertex = (DVec3, DVec3, DVec2);

/// Adds a vertex and returns its index.
pub(super) fn push_vertex(mesh: &mut Mesh, (position, normal, uv): Vertex) -> u32 {
    mesh.positions.push(position.as_vec3());
    mesh.normals.push(normal.as_vec3());
    mesh.uvs[0].push(uv.as_vec2());
    (mesh.positions.len() - 1) as u32
}

/// Adds a triangle of a material.
pub(super) fn push_triangle(mesh: &mut Mesh, triangle: [u32; 3], material: u32) {
    mesh.triangles.push(triangle);
    mesh.triangle_materials.push(material);
}

/// Adds the parallelogram with corners `origin`, `origin + u` and `origin + v`, whose normal is `u x v`.
pub(super) fn push_quad(mesh: &mut Mesh, origin: DVec3, u: DVec3, v: DVec3, material: u32) {
    let normal = u.cross(v).normalize();
    let corners = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
    // v runs up while texture rows run down.
    let [a, b, c, d] =
        corners.map(|(x, y)| push_vertex(mesh, (origin + u * x + v * y, normal, DVec2::new(x, 1.0 - y))));
    push_triangle(mesh, [a, b, c], material);
    push_triangle(mesh, [a, c, d], material);
}

/// A mesh without anything in it yet.
pub(super) fn empty(name: &str) -> Mesh {
    Mesh { name: name.to_owned(), ..Mesh::default() }
}

/// The box from -0.5 to 0.5, 12 triangles.
pub(super) fn cube(name: &str, material: u32) -> Mesh {
    let mut mesh = empty(name);
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        let (u, v) = (DVec3::new(axis.z, axis.x, axis.y), DVec3::new(axis.y, axis.z, axis.x));
        let (u, v) = if u.cross(v).dot(axis) > 0.0 { (u, v) } else { (v, u) };
        push_quad(&mut mesh, (axis - u - v) * 0.5, u, v, material);
        push_quad(&mut mesh, (-axis - u - v) * 0.5, v, u, material);
    }
    mesh
}

/// A sphere around the origin: `2 * sectors * (rings - 1)` triangles, seams and poles closed by equal positions.
pub(super) fn sphere(name: &str, radius: f64, rings: u32, sectors: u32, material: u32) -> Mesh {
    let mut mesh = empty(name);
    for i in 0..=rings {
        for j in 0..=sectors {
            let (u, v) = (f64::from(j) / f64::from(sectors), f64::from(i) / f64::from(rings));
            // The seam's last column repeats the first exactly, and the poles have no radius, so nothing can crack.
            let ring = if i == 0 || i == rings { 0.0 } else { (v * PI).sin() };
            let angle = f64::from(j % sectors) / f64::from(sectors) * TAU;
            let normal = DVec3::new(ring * angle.cos(), (v * PI).cos(), -ring * angle.sin());
            push_vertex(&mut mesh, (normal * radius, normal, DVec2::new(u, v)));
        }
    }
    push_rings(&mut mesh, rings, sectors, material);
    mesh
}

/// What an outline makes that turns around the y axis, from a point on that axis to another: clockwise around what is inside, with
/// the axis on its left. Corners in between are rounded by the radius that comes with them, so that normals are smooth.
pub(super) fn lathe(name: &str, outline: &[(DVec2, f64)], sectors: u32, material: u32) -> Mesh {
    let profile = rounded(outline);
    let mut mesh = empty(name);
    for (i, (point, normal)) in profile.iter().enumerate() {
        for j in 0..=sectors {
            let (sin, cos) = (f64::from(j % sectors) / f64::from(sectors) * TAU).sin_cos();
            let turned = |p: DVec2| DVec3::new(p.x * cos, p.y, -p.x * sin);
            let uv = DVec2::new(f64::from(j) / f64::from(sectors), i as f64 / (profile.len() - 1) as f64);
            push_vertex(&mut mesh, (turned(*point), turned(*normal), uv));
        }
    }
    push_rings(&mut mesh, profile.len() as u32 - 1, sectors, material);
    mesh
}

/// Points of an outline, and its normals there.
fn rounded(outline: &[(DVec2, f64)]) -> Vec<(DVec2, DVec2)> {
    const STEPS: u32 = 6;
    let last = outline.len() - 1;
    let along = |i: usize| (outline[i + 1].0 - outline[i].0).normalize();
    let mut profile = vec![(outline[0].0, along(0).perp())];
    for (i, &(corner, radius)) in outline.iter().enumerate().take(last).skip(1) {
        let (from, to) = (along(i - 1), along(i));
        let turn = from.angle_to(to);
        let start = corner - from * (radius * (0.5 * turn).tan().abs());
        let centre = start + from.perp() * radius * turn.signum();
        for k in 0..=STEPS {
            let normal = DVec2::from_angle(turn * f64::from(k) / f64::from(STEPS)).rotate(from.perp());
            profile.push((centre - normal * radius * turn.signum(), normal));
        }
    }
    profile.push((outline[last].0, along(last - 1).perp()));
    profile
}

/// Joins rows of `sectors + 1` vertices, the first and the last of which are poles.
fn push_rings(mesh: &mut Mesh, rings: u32, sectors: u32, material: u32) {
    let row = sectors + 1;
    for i in 0..rings {
        for j in 0..sectors {
            let a = i * row + j;
            if i + 1 < rings {
                push_triangle(mesh, [a, a + row, a + row + 1], material);
            }
            if i > 0 {
                push_triangle(mesh, [a, a + row + 1, a + 1], material);
            }
        }
    }
}

/// A grid in the xz plane of `columns * rows` vertices; `vertex` gives the vertex at column and row.
pub(super) fn grid(name: &str, columns: u32, rows: u32, material: u32, vertex: impl Fn(u32, u32) -> Vertex) -> Mesh {
    let mut mesh = empty(name);
    for j in 0..rows {
        for i in 0..columns {
            push_vertex(&mut mesh, vertex(i, j));
        }
    }
    for j in 0..rows - 1 {
        for i in 0..columns - 1 {
            let a = j * columns + i;
            push_triangle(&mut mesh, [a, a + columns, a + columns + 1], material);
            push_triangle(&mut mesh, [a, a + columns + 1, a + 1], material);
        }
    }
    mesh
}

/// Mirrors what every scene promises about vertex arrays, for shapes that have no texture coordinates.
pub(super) fn push_bare_vertex(mesh: &mut Mesh, position: Vec3, normal: Vec3) -> u32 {
    mesh.positions.push(position);
    mesh.normals.push(normal);
    mesh.uvs[0].push(Vec2::ZERO);
    (mesh.positions.len() - 1) as u32
}
