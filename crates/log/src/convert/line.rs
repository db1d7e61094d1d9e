//! Measured lines and the edges of targets.

use super::fields::{Malformed, flat, matrix};
use crate::{
    proto,
    record::{EdgePair, Line, ModelEdge, Offset},
};

pub(super) fn line_message(line: &Line) -> proto::Line {
    proto::Line {
        ends: line.ends.as_flattened().to_vec(),
        covariance: flat(&line.covariance),
        depth: line.depth,
        offsets: line.segments.iter().flatten().flatten().map(offset_message).collect(),
    }
}

fn offset_message(offset: &Offset) -> proto::Offset {
    let &Offset { at: [u, v], normal: [normal_u, normal_v], sigma, texture, common } = offset;
    proto::Offset { u, v, normal_u, normal_v, sigma, texture, common }
}

pub(super) fn line_record(message: &proto::Line) -> Result<Line, Malformed> {
    let segments = match &message.offsets[..] {
        [] => None,
        [a, b, c, d] => Some([[offset_record(a), offset_record(b)], [offset_record(c), offset_record(d)]]),
        other => return Err(Malformed(format!("lines.offsets has {} entries instead of 4", other.len()))),
    };
    Ok(Line {
        ends: matrix("lines.ends", &message.ends)?,
        covariance: matrix("lines.covariance", &message.covariance)?,
        depth: message.depth,
        segments,
    })
}

fn offset_record(message: &proto::Offset) -> Offset {
    let &proto::Offset { u, v, normal_u, normal_v, sigma, texture, common } = message;
    Offset { at: [u, v], normal: [normal_u, normal_v], sigma, texture, common }
}

pub(super) fn edge_message(edge: ModelEdge) -> proto::ModelEdge {
    proto::ModelEdge { id: edge.id, ends: edge.ends.as_flattened().to_vec() }
}

pub(super) fn edge_record(message: proto::ModelEdge) -> Result<ModelEdge, Malformed> {
    Ok(ModelEdge { ends: matrix("target.edges.ends", &message.ends)?, id: message.id })
}

pub(super) fn edge_pair_messages(pairs: &[EdgePair]) -> Vec<proto::EdgePair> {
    pairs.iter().map(|&EdgePair { model, line }| proto::EdgePair { model, line }).collect()
}

pub(super) fn edge_pair_records(messages: &[proto::EdgePair]) -> Vec<EdgePair> {
    messages.iter().map(|&proto::EdgePair { model, line }| EdgePair { model, line }).collect()
}
