//! Skins: vertices where the joints of the scene, as it stands, carry them.

use super::accessor::Arrays;
use super::json::Item;
use super::mesh::cofactors;
use super::primitive::Primitive;
use crate::Result;
use glam::{DAffine3, DMat3, DMat4, DVec3};

/// The matrix of each joint of `skins[index]`: its transform to the world times its inverse bind matrix.
pub(super) fn joint_matrices(
    item: &Item,
    arrays: &Arrays,
    nodes: &[Item],
    transforms: &[Option<DAffine3>],
) -> Result<Vec<DAffine3>> {
    let joints = item.need("joints")?.elements()?;
    let binds = match item.get("inverseBindMatrices")? {
        None => vec![DAffine3::IDENTITY; joints.len()],
        Some(reference) => {
            let matrices = arrays.numbers::<16>(&reference, "MAT4")?;
            if matrices.len() < joints.len() {
                let problem = format!("holds {} matrices for {} joints", matrices.len(), joints.len());
                return Err(reference.error(problem));
            }
            if matrices.iter().flatten().any(|number| !number.is_finite()) {
                return Err(reference.error("holds a matrix that is not finite"));
            }
            matrices.iter().map(|numbers| DAffine3::from_mat4(DMat4::from_cols_array(numbers))).collect()
        }
    };
    let matrix = |(joint, bind): (&Item, DAffine3)| {
        let node = joint.index(nodes.len(), "nodes")?;
        let to_world = transforms[node].ok_or_else(|| joint.error(format!("nodes[{node}] is not in the scene")))?;
        Ok(to_world * bind)
    };
    joints.iter().zip(binds).map(matrix).collect()
}

/// The primitive in the world, its vertices where their joints carry them (linear blend skinning).
pub(super) fn posed<'a>(primitive: &Primitive<'a>, matrices: &[DAffine3]) -> Result<Primitive<'a>> {
    let mut posed = primitive.clone();
    let Some(joints) = posed.joints.take() else { return Ok(posed) };
    let mut mirrored = vec![false; posed.positions.len()];
    for (vertex, joints) in joints.iter().enumerate() {
        let (mut linear, mut translation) = (DMat3::ZERO, DVec3::ZERO);
        for &(joint, share) in joints {
            let Some(matrix) = matrices.get(joint) else {
                let count = matrices.len();
                return Err(primitive.item.error(format!("vertex {vertex} names joint {joint} of a skin of {count}")));
            };
            linear += matrix.matrix3 * share;
            translation += matrix.translation * share;
        }
        mirrored[vertex] = linear.determinant() < 0.0;
        let side = if mirrored[vertex] { -1.0 } else { 1.0 };
        posed.positions[vertex] = linear * posed.positions[vertex] + translation;
        if let Some(normals) = &mut posed.normals {
            normals[vertex] = cofactors(&linear) * normals[vertex] * side;
        }
        if let Some(tangents) = &mut posed.tangents {
            tangents[vertex] = (linear * tangents[vertex].0, tangents[vertex].1 * side);
        }
    }
    for corners in &mut posed.corners {
        if mirrored[corners[0] as usize] {
            corners.swap(1, 2);
        }
    }
    Ok(posed)
}
