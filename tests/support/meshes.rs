//! Meshes as texts of files.

use polhode::bodies::inertia::TriangleMesh;

pub fn obj_text(mesh: &TriangleMesh) -> String {
    let vertices = mesh.vertices().iter().map(|v| format!("v {:?} {:?} {:?}\n", v.x, v.y, v.z));
    let faces = mesh.triangles().iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    vertices.chain(faces).collect()
}

pub fn stl_text(mesh: &TriangleMesh) -> String {
    let facets = mesh.triangles().iter().map(|triangle| {
        let corners = triangle.map(|v| mesh.vertices()[v].as_vec3());
        let lines: String = corners.iter().map(|c| format!("vertex {:?} {:?} {:?}\n", c.x, c.y, c.z)).collect();
        format!("facet normal 0 0 0\nouter loop\n{lines}endloop\nendfacet\n")
    });
    format!("solid body\n{}endsolid body\n", facets.collect::<String>())
}
