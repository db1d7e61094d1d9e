//! Every message decodes under the descriptor that stands beside it in the file, without a rest; the topics are those of the
//! documentation.

use std::collections::BTreeSet;

use prost_reflect::{DescriptorPool, DynamicMessage};

use crate::synthetic;

/// Seen to fail with the descriptor of another message.
#[test]
fn every_message_decodes_under_its_own_descriptor() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("t.mcap");
    synthetic::write(&path, 4);
    let bytes = std::fs::read(&path).unwrap();
    let (mut topics, mut last) = (BTreeSet::new(), 0);
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        assert!(message.log_time == message.publish_time && message.log_time >= last);
        last = message.log_time;
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!([&schema.encoding, &message.channel.message_encoding], ["protobuf"; 2]);
        let pool = DescriptorPool::decode(&schema.data[..]).unwrap();
        let descriptor = pool.get_message_by_name(&schema.name).unwrap();
        let decoded = DynamicMessage::decode(descriptor, &message.data[..]).unwrap();
        assert_eq!(decoded.unknown_fields().count(), 0, "{}", schema.name);
        topics.insert(message.channel.topic.clone());
    }
    assert_eq!(topics, documented());
}

/// The topics in the table of the crate's documentation.
fn documented() -> BTreeSet<String> {
    let rows = include_str!("../../src/lib.rs").lines().filter(|line| line.starts_with("//! | `/"));
    let quoted = rows.flat_map(|row| row.split('`').skip(1).step_by(2));
    quoted.filter(|word| word.starts_with('/')).map(str::to_owned).collect()
}
