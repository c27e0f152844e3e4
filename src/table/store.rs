//! The bytes of a table, little-endian: "TLWT", the version, the index of refraction and g, then node by node the radius
//! and, albedo by albedo, the totals and for each cell within the sphere ln R (16 bits, a step of .0014) and its error (8
//! bits, steps of 6 %); at the end the SHA-256 of all before.

use super::walk::{CELLS, Estimate, reached};
use super::white::{Curve, EXTENTS, Node, White};
use sha2::{Digest, Sha256};

/// Changes whenever the same parameters would give other bytes.
pub const VERSION: u32 = 2;
const MAGIC: &[u8; 4] = b"TLWT";
/// ln R of the codes 0 and 65535.
const RANGE: (f64, f64) = (-80.0, 10.0);

/// The bytes of a table.
pub fn encode(table: &White) -> Vec<u8> {
    let mut bytes = MAGIC.to_vec();
    bytes.extend(VERSION.to_le_bytes());
    bytes.extend(table.ior.to_le_bytes());
    bytes.extend(table.g.to_le_bytes());
    bytes.extend((table.nodes.len() as u32).to_le_bytes());
    for node in &table.nodes {
        bytes.extend(node.radius.to_le_bytes());
        for curve in &node.albedos {
            for value in [curve.total.mean, curve.total.error, curve.diffuse.mean, curve.diffuse.error] {
                bytes.extend((value as f32).to_le_bytes());
            }
            for cell in 0..reached(node.radius) {
                let share = (curve.logarithm[cell] - RANGE.0) / (RANGE.1 - RANGE.0);
                bytes.extend(((share * 65535.0).round() as u16).to_le_bytes());
                bytes.push((-16.0 * curve.error[cell].ln()).round() as u8);
            }
        }
    }
    bytes.extend(Sha256::digest(&bytes));
    bytes
}

/// The table of the bytes; none if they are not exactly what [`encode`] writes.
pub fn decode(bytes: &[u8]) -> Option<White> {
    let (content, digest) = bytes.split_last_chunk::<32>()?;
    if Sha256::digest(content).as_slice() != digest {
        return None;
    }
    let mut reader = Reader(content);
    if reader.take()? != *MAGIC || u32::from_le_bytes(reader.take()?) != VERSION {
        return None;
    }
    let (ior, g) = (reader.double()?, reader.double()?);
    let nodes = u32::from_le_bytes(reader.take()?);
    let nodes = (0..nodes).map(|_| reader.node()).collect::<Option<Vec<Node>>>()?;
    (reader.0.is_empty() && !nodes.is_empty()).then_some(White { ior, g, nodes })
}

struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (first, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*first)
    }

    fn double(&mut self) -> Option<f64> {
        self.take().map(f64::from_le_bytes)
    }

    fn estimate(&mut self) -> Option<Estimate> {
        let mut value = || self.take().map(|bytes| f64::from(f32::from_le_bytes(bytes)));
        Some(Estimate { mean: value()?, error: value()? })
    }

    fn node(&mut self) -> Option<Node> {
        let radius = self.double()?;
        let albedos = (0..EXTENTS.len()).map(|_| self.curve(radius)).collect::<Option<Vec<Curve>>>()?;
        Some(Node { radius, albedos })
    }

    fn curve(&mut self, radius: f64) -> Option<Curve> {
        let (total, diffuse) = (self.estimate()?, self.estimate()?);
        let (mut logarithm, mut error) = (vec![RANGE.0; CELLS], vec![1.0; CELLS]);
        for cell in 0..reached(radius) {
            let code = f64::from(u16::from_le_bytes(self.take()?));
            logarithm[cell] = RANGE.0 + code / 65535.0 * (RANGE.1 - RANGE.0);
            error[cell] = (-f64::from(self.take::<1>()?[0]) / 16.0).exp();
        }
        Some(Curve { total, diffuse, logarithm, error })
    }
}
