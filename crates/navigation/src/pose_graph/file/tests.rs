use super::*;

fn pose_graph() -> PoseGraph {
    let pose = |x: f64| Transform::exp(&[0.1, 0.2, 0.3, x, 2.0, 3.0].into());
    let place =
        ObjectPlacement { world_from_object: pose(1.0).relabel(), covariance: Covariance6::isotropic(0.01, 0.02) };
    let mut pose_graph = PoseGraph::new(vec![("box".to_owned(), place)]);
    let point = |x: f64| UncertainPoint::isotropic(Point::new(x, 0.1, 3.0), 0.01);
    let keypoint = |u: f64| Keypoint { at: Pixel { u, v: 7.5 }, response: 3.0, scale: 2.0 };
    let keyframe = KeyFrame {
        points: vec![point(0.1), point(1.0 / 3.0)],
        keypoints: vec![keypoint(10.1), keypoint(20.7)],
        descriptors: Descriptors::Numbers(Table::new(3, vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6])),
    };
    let pose_node = |stamp_ns, keyframe| PoseNode { stamp_ns, world_from_camera: pose(4.0), sigma: 0.1, keyframe };
    pose_graph.add_node(pose_node(5, Some(keyframe)));
    pose_graph.add_node(pose_node(9, None));
    let motion = RelativeMotion::new(pose(0.1 + 0.2).relabel(), Covariance6::isotropic(0.01, 0.02));
    pose_graph.odometry_edges.push(OdometryEdge {
        from: 0,
        to: 1,
        motion: RelativeMotion { correlated: Some(correlated()), ..motion },
    });
    pose_graph.loops.push(OdometryEdge { from: 0, to: 1, motion });
    let object_pose = ObjectPose::new(pose(9.0).relabel(), Covariance6::isotropic(1e-3, 2e-3));
    pose_graph.fixes.push(FixEdge { pose_node: 1, navigated: Navigated { object: 0, object_pose } });
    let covariance = Covariance6::isotropic(0.1, 0.5);
    pose_graph.prior_poses.push(PriorPose { pose_node: 0, world_from_camera: pose(4.1), covariance });
    pose_graph
}

/// Correlated errors with a scale that causes a tenth of the motion's variance, and a held reading.
fn correlated() -> CorrelatedError {
    let (mut by, mut with) = (CorrelatedSensitivities::zeros(), CorrelatedSensitivities::zeros());
    (by[(3, 0)], with[(3, 0)]) = (0.1 + 0.2, (0.1 + 0.2) * 1e-6);
    let mut keep = SVector::zeros();
    keep[0] = 1.0;
    let spread = |held| CorrelatedCovariance { independent: Vector4::new(1e-6, 0.0, 0.0, 0.0), held };
    let (before, after) = (spread(Matrix6::zeros()), spread(Matrix6::identity() * 1e-6));
    with.fixed_view_mut::<6, 6>(0, 4).copy_from(&after.held);
    CorrelatedError { by, keep, with, before, after }
}

#[test]
fn what_is_written_is_read() {
    let recognition = Recognition::default();
    let text = pose_graph().text(&recognition);
    let again = PoseGraph::read(Path::new("n.jsonl"), &text, &recognition).unwrap();
    assert_eq!(again.pose_nodes[0].keyframe, pose_graph().pose_nodes[0].keyframe, "to the last bit");
    assert_eq!(
        (again.pose_nodes.len(), again.odometry_edges.len(), again.loops.len(), again.fixes.len()),
        (2, 1, 1, 1)
    );
    assert_eq!(again.odometry_edges[0].motion.correlated, Some(correlated()), "to the last bit");
    let off = again.pose_nodes[0].world_from_camera.error_to(&pose_graph().pose_nodes[0].world_from_camera);
    assert!(off.norm() < 1e-12);
    assert_eq!(pose_graph().text(&recognition), text);
}

#[test]
fn every_fault_is_one_line_with_its_place() {
    let recognition = Recognition::default();
    let text = pose_graph().text(&recognition);
    let lines: Vec<&str> = text.lines().collect();
    let message = |text: &str| PoseGraph::read(Path::new("n.jsonl"), text, &recognition).unwrap_err().to_string();
    assert!(message("").contains("missing end line in n.jsonl:0"), "{}", message(""));
    assert!(message(&lines[..4].join("\n")).contains("missing end line in n.jsonl:4"));
    assert!(message(&text[..text.len() / 2]).contains("cut off"), "{}", message(&text[..text.len() / 2]));
    let without = |line: usize| {
        let mut rest = lines.clone();
        rest.remove(line);
        message(&rest.join("\n"))
    };
    assert!(without(0).contains("first line"), "{}", without(0));
    assert!(without(5).contains("missing lines in n.jsonl"), "{}", without(5));
    assert!(without(3).contains("missing or later line in n.jsonl:4: 1 of 1"), "{}", without(3));
    let with = |from: &str, to: &str| message(&text.replacen(from, to, 1));
    assert!(with("pose-graph/2", "pose-graph/9").contains("unknown format in n.jsonl:1"));
    assert!(with("\"sigma\":0.1", "\"sigma\":-0.1").contains("invalid standard deviation in n.jsonl:3: -0.1"));
    assert!(with("\"count\":2", "\"count\":3").contains("corrupt key frame in n.jsonl:3"));
    assert!(with("\"stamp_ns\"", "\"stamp\"").contains("unknown field"));
    assert!(with("[1e-6,0.0", "[-1e-6,0.0").contains("invalid variances in n.jsonl:5: [-1e-6"));
    assert!(with("[1e-6,0.0", "[1.0,0.0").contains("contradict the motion's covariance in n.jsonl:5: from"));
    let other = Recognition { points: 100, descriptor: seafix_component::Choice::named("orb"), ..recognition.clone() };
    let unlike = PoseGraph::read(Path::new("n.jsonl"), &text, &other).unwrap_err().to_string();
    assert!(unlike.contains("described with other settings") && unlike.contains(": descriptor;"), "{unlike}");
    assert_eq!(with("box", "b\u{7}x").lines().count(), 1);
}
