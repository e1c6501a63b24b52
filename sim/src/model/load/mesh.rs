//! Triangle meshes from OBJ, STL and MSH files.

use glam::Vec3;
use std::{io::Cursor, path::Path};

/// Largest mesh file that is read, bytes.
const MAX_BYTES: u64 = 32 * 1024 * 1024;
/// Most triangles of one mesh.
const MAX_TRIANGLES: usize = 200_000;

/// Triangles with shared corners, in the file's own units.
#[derive(Debug, Clone, Default)]
pub(super) struct Triangles {
    pub(super) positions: Vec<Vec3>,
    pub(super) corners: Vec<[u32; 3]>,
}

/// Reads a file by its ending.
pub(super) fn read(path: &Path) -> Result<Triangles, String> {
    let wrong = |reason: String| format!("mesh {}: {reason}", path.display());
    let length = std::fs::metadata(path).map_err(|e| wrong(e.to_string()))?.len();
    if length > MAX_BYTES {
        return Err(wrong(format!("{length} bytes, the limit is {MAX_BYTES}; simplify it first")));
    }
    let bytes = std::fs::read(path).map_err(|e| wrong(e.to_string()))?;
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default().to_lowercase();
    let triangles = match ending.as_str() {
        "obj" => obj(&bytes),
        "stl" => stl(&bytes),
        "msh" => msh(&bytes),
        other => Err(format!("files of kind `{other}` are not read; convert it to obj or stl")),
    };
    let triangles = triangles.map_err(wrong)?;
    check(&triangles).map_err(wrong)?;
    Ok(triangles)
}

fn check(triangles: &Triangles) -> Result<(), String> {
    if triangles.corners.is_empty() {
        return Err("has no triangles".into());
    }
    if triangles.corners.len() > MAX_TRIANGLES {
        return Err(format!("{} triangles, the limit is {MAX_TRIANGLES}; simplify it first", triangles.corners.len()));
    }
    if let Some(at) = triangles.positions.iter().position(|point| !point.is_finite()) {
        return Err(format!("vertex {at} is not finite"));
    }
    let count = triangles.positions.len();
    let bad = triangles.corners.iter().position(|corners| corners.iter().any(|corner| *corner as usize >= count));
    bad.map_or(Ok(()), |at| Err(format!("triangle {at} uses a vertex that is not there")))
}

fn obj(bytes: &[u8]) -> Result<Triangles, String> {
    let options = tobj::LoadOptions { triangulate: true, single_index: true, ..tobj::LoadOptions::default() };
    // Materials are not read: their textures would not be drawn.
    let none = |_: &Path| tobj::load_mtl_buf(&mut Cursor::new(&[] as &[u8]));
    let (models, _) = tobj::load_obj_buf(&mut Cursor::new(bytes), &options, none).map_err(|e| e.to_string())?;
    let mut all = Triangles::default();
    for model in models {
        let first = all.positions.len() as u32;
        all.positions.extend(model.mesh.positions.chunks_exact(3).map(Vec3::from_slice));
        let corners = model.mesh.indices.chunks_exact(3).map(|c| [c[0] + first, c[1] + first, c[2] + first]);
        all.corners.extend(corners);
    }
    Ok(all)
}

fn stl(bytes: &[u8]) -> Result<Triangles, String> {
    let mesh = stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|e| e.to_string())?;
    Ok(Triangles {
        positions: mesh.vertices.iter().map(|vertex| Vec3::new(vertex[0], vertex[1], vertex[2])).collect(),
        corners: mesh.faces.iter().map(|face| face.vertices.map(|corner| corner as u32)).collect(),
    })
}

/// MuJoCo's binary meshes.
fn msh(bytes: &[u8]) -> Result<Triangles, String> {
    // The reader believes the counts at the start, so they are compared with the file's length before.
    let count = |at: usize| {
        let bytes = bytes.get(4 * at..4 * at + 4).and_then(|b| <[u8; 4]>::try_from(b).ok());
        bytes.and_then(|bytes| u64::try_from(i32::from_le_bytes(bytes)).ok()).ok_or("is cut short")
    };
    let (points, normals, texture, faces) = (count(0)?, count(1)?, count(2)?, count(3)?);
    if 16 + 12 * (points + normals + faces) + 8 * texture != bytes.len() as u64 {
        return Err("its counts do not fit its length".into());
    }
    let mesh = mjcf_rs::msh::parse(bytes).map_err(|e| e.to_string())?;
    Ok(Triangles {
        positions: mesh.vertices.chunks_exact(3).map(Vec3::from_slice).collect(),
        corners: mesh.faces.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

    fn read_text(name: &str, bytes: &[u8]) -> Result<Triangles, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, bytes).unwrap();
        read(&path)
    }

    #[test]
    fn quads_become_triangles_and_mistakes_are_named() {
        let square = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
        let mesh = read_text("a.obj", square).unwrap();
        assert_eq!((mesh.positions.len(), mesh.corners.len()), (4, 2));
        let error = |name: &str, bytes: &[u8]| read_text(name, bytes).unwrap_err();
        assert!(error("a.obj", b"v 0 0 0\n").contains("no triangles"));
        assert!(error("a.obj", b"v 0 0 nan\nv 1 0 0\nv 1 1 0\nf 1 2 3\n").contains("a.obj"));
        assert!(error("a.dae", b"").contains("convert it to obj or stl"));
        assert!(error("a.msh", &[255; 16]).contains("a.msh"));
        assert!(error("a.stl", b"solid").contains("a.stl"));
    }

    #[test]
    fn a_mesh_of_mujoco_is_read() {
        let mut bytes: Vec<u8> = [3i32, 0, 0, 1].iter().flat_map(|n| n.to_le_bytes()).collect();
        bytes.extend([0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|n| n.to_le_bytes()));
        bytes.extend([0i32, 1, 2].iter().flat_map(|n| n.to_le_bytes()));
        assert_eq!(read_text("a.msh", &bytes).unwrap().corners, [[0, 1, 2]]);
        bytes.truncate(40);
        assert!(read_text("a.msh", &bytes).unwrap_err().contains("length"));
    }
}
