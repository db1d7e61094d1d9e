//! Marks in the images: key points and measured lines white, candidates blue, identified points ringed and identified
//! edges drawn in the colour of their target, both named.

use std::collections::BTreeSet;

use crate::{
    proto::foxglove::{
        CircleAnnotation, Color, ImageAnnotations, KeyValuePair, Point2, PointsAnnotation, TextAnnotation,
        points_annotation,
    },
    record::{FrameRecord, Line, TrialHeader},
};

use super::values::{colour, colour_message, timestamp};

/// The marks in the left (0) or right (1) image.
pub(crate) fn annotations(header: &TrialHeader, frame: &FrameRecord, side: usize) -> ImageAnnotations {
    let camera = [&header.rig.left, &header.rig.right][side];
    let columns = frame.images.as_ref().map_or(camera.size[0], |images| images[side].width);
    let fraction = f64::from(columns) / f64::from(camera.size[0]);
    // From the centre of the first pixel at (0, 0) to its corner at (0, 0), and to a thumbnail's pixels.
    let mark = |[u, v]: [f64; 2]| Point2 { x: (u + 0.5) * fraction, y: (v + 0.5) * fraction };
    let seen = |cloud: u32| {
        frame.cloud[cloud as usize].pixels.map(|pixels| if side == 0 { pixels.left } else { pixels.right })
    };
    let key_points: Vec<Point2> = if side == 0 {
        frame.key_points.iter().copied().map(mark).collect()
    } else {
        frame.cloud.iter().filter_map(|point| point.pixels).map(|pixels| mark(pixels.right)).collect()
    };
    let candidates: BTreeSet<u32> = frame.targets.iter().flat_map(|target| target.candidates.concat()).collect();
    let candidates = candidates.into_iter().filter_map(seen).map(mark).collect();

    let (mut circles, mut texts) = (Vec::new(), Vec::new());
    for target in &frame.targets {
        let Some(index) = header.targets.iter().position(|model| model.id == target.object) else { continue };
        let colour = colour_message(colour(index));
        for (place, pair) in target.pairs.iter().enumerate() {
            let Some(at) = seen(pair.cloud).map(mark) else { continue };
            let used = target.used.contains(&(place as u32));
            let id = &header.targets[index].points[pair.model as usize].id;
            circles.push(CircleAnnotation {
                timestamp: Some(timestamp(frame.stamp_ns)),
                position: Some(at),
                diameter: 12.0,
                thickness: if used { 3.0 } else { 1.5 },
                fill_color: Some(Color { a: 0.0, ..colour }),
                outline_color: Some(colour),
                metadata: vec![
                    KeyValuePair { key: "object".to_owned(), value: target.object.clone() },
                    KeyValuePair { key: "point".to_owned(), value: id.clone() },
                    KeyValuePair { key: "used".to_owned(), value: used.to_string() },
                ],
            });
            texts.push(TextAnnotation {
                timestamp: Some(timestamp(frame.stamp_ns)),
                position: Some(Point2 { x: at.x + 8.0, y: at.y - 8.0 }),
                text: id.clone(),
                font_size: 12.0,
                text_color: Some(colour),
                background_color: Some(Color { r: 0.0, g: 0.0, b: 0.0, a: 0.5 }),
                metadata: Vec::new(),
            });
        }
    }
    use points_annotation::Type;
    let marked = |kind: Type, points, colour: [u8; 3], thickness| PointsAnnotation {
        timestamp: Some(timestamp(frame.stamp_ns)),
        r#type: kind.into(),
        points,
        outline_color: Some(colour_message(colour)),
        thickness,
        ..PointsAnnotation::default()
    };
    let segment = |line: &Line| line.segments.map(|segments| segments[side].map(|offset| mark(offset.at)));
    let mut points =
        vec![marked(Type::Points, key_points, [255; 3], 2.0), marked(Type::Points, candidates, [86, 180, 233], 4.0)];
    let lines: Vec<Point2> = frame.lines.iter().filter_map(segment).flatten().collect();
    if !lines.is_empty() {
        points.push(marked(Type::LineList, lines, [255; 3], 1.0));
    }
    for target in frame.targets.iter().filter(|target| !target.edges.is_empty()) {
        let Some(index) = header.targets.iter().position(|model| model.id == target.object) else { continue };
        let identified = target.edges.iter().filter_map(|pair| {
            let ends = segment(frame.lines.get(pair.line as usize)?)?;
            Some((header.targets[index].edges.get(pair.model as usize)?, ends))
        });
        let identified: Vec<_> = identified.collect();
        for (edge, [from, to]) in &identified {
            texts.push(TextAnnotation {
                timestamp: Some(timestamp(frame.stamp_ns)),
                position: Some(Point2 { x: (from.x + to.x) / 2.0, y: (from.y + to.y) / 2.0 }),
                text: edge.id.clone(),
                font_size: 10.0,
                text_color: Some(colour_message(colour(index))),
                background_color: Some(Color { r: 0.0, g: 0.0, b: 0.0, a: 0.5 }),
                metadata: Vec::new(),
            });
        }
        let ends = identified.into_iter().flat_map(|(_, ends)| ends).collect();
        points.push(marked(Type::LineList, ends, colour(index), 3.0));
    }
    ImageAnnotations { timestamp: Some(timestamp(frame.stamp_ns)), circles, points, texts, metadata: Vec::new() }
}
