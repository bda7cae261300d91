//! rosbag2's SQLite files (`.db3`): opened read-only and immutable, so that nothing beside the file is made or touched.

use super::definition::MAX_TEXT;
use super::joint_states::{JointStates, TopicId};
use super::mapping::Schema;
use super::mcap::MAX_RECORD;
use super::unpack::PackedMessages;
use crate::error::{Error, Place, Result};
use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags};
use std::collections::BTreeMap;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::rc::Rc;

/// Hands all messages of topics that are read in the file at `path` to `sink`; `file` is what messages call it.
///
/// # Errors
/// [`Error::Content`] for files that are still being written, damaged, or no bag.
pub(super) fn read(path: &Path, file: &str, sink: &mut JointStates<'_>) -> Result<()> {
    refuse_unfinished(path, file)?;
    let broken = |e: rusqlite::Error| {
        Error::content(
            Place::file(file),
            format!("is not a whole SQLite bag: {e}"),
            "copy it again, or mend it with `ros2 bag convert`",
        )
    };
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_URI
        | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let bag = Connection::open_with_flags(uri(path), flags).map_err(broken)?;
    let limit = i32::try_from(MAX_RECORD).unwrap_or(i32::MAX);
    bag.set_limit(Limit::SQLITE_LIMIT_LENGTH, limit)
        .map_err(broken)?;
    // A view called `messages` could compute without end.
    for table in ["topics", "messages"] {
        let query = "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = ?1";
        let count: i64 = bag
            .query_row(query, [table], |row| row.get(0))
            .map_err(broken)?;
        if count != 1 {
            return Err(Error::content(
                Place::file(file),
                format!("is a SQLite file without a table `{table}`"),
                "give a bag of rosbag2",
            ));
        }
    }
    let mut topics: BTreeMap<i64, TopicId> = BTreeMap::new();
    let mut query = bag
        .prepare("SELECT id, name, type, serialization_format FROM topics ORDER BY id")
        .map_err(broken)?;
    let mut rows = query.query([]).map_err(broken)?;
    while let Some(row) = rows.next().map_err(broken)? {
        let text = |column| row.get::<_, String>(column).map_err(broken);
        let (name, kind, encoding) = (text(1)?, text(2)?, text(3)?);
        let schema = Rc::new(definition(&bag, kind).map_err(broken)?);
        let topic = sink.topic(&name, Some(schema), &encoding)?;
        topics.insert(row.get(0).map_err(broken)?, topic);
    }
    let mut query = bag
        .prepare("SELECT topic_id, timestamp, data FROM messages ORDER BY id")
        .map_err(broken)?;
    let mut rows = query.query([]).map_err(broken)?;
    let mut packed = PackedMessages::default();
    while let Some(row) = rows.next().map_err(broken)? {
        let (topic, time): (i64, i64) = (row.get(0).map_err(broken)?, row.get(1).map_err(broken)?);
        let Some(&topic) = topics.get(&topic) else {
            return Err(Error::content(
                Place::file(file),
                format!("a message is of topic {topic}, which is not in the table `topics`"),
                "copy it again, or mend it with `ros2 bag convert`",
            ));
        };
        let data = row.get_ref(2).map_err(broken)?;
        let data = data
            .as_bytes()
            .map_err(|_| broken(rusqlite::Error::InvalidQuery))?;
        let time = time.cast_unsigned();
        let data = if sink.reads(topic) {
            packed.unpack(data)
        } else {
            data
        };
        sink.message(topic, time, data)?;
    }
    Ok(())
}

/// What the bag says of a message type; bags before ROS 2 Iron have no definitions.
fn definition(bag: &Connection, kind: String) -> rusqlite::Result<Schema> {
    let query =
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND name = 'message_definitions'";
    let tables: i64 = bag.query_row(query, [], |row| row.get(0))?;
    let mut schema = Schema {
        kind,
        ..Schema::default()
    };
    if tables == 0 {
        return Ok(schema);
    }
    let query = "SELECT encoding, encoded_message_definition FROM message_definitions \
                 WHERE topic_type = ?1 AND length(encoded_message_definition) <= ?2";
    let mut query = bag.prepare(query)?;
    let limit = i64::try_from(MAX_TEXT).unwrap_or(i64::MAX);
    let mut rows = query.query(rusqlite::params![schema.kind, limit])?;
    if let Some(row) = rows.next()? {
        schema.language = row.get(0)?;
        schema.text = row.get(1)?;
    }
    Ok(schema)
}

/// A log that is still being written has a file beside it that holds what is missing.
fn refuse_unfinished(path: &Path, file: &str) -> Result<()> {
    for ending in ["-wal", "-journal"] {
        let mut beside = path.as_os_str().to_owned();
        beside.push(ending);
        let bytes = std::fs::metadata(&beside).map_or(0, |m| m.len());
        if bytes > 0 {
            return Err(Error::content(
                Place::file(file),
                format!(
                    "is still being written, or its recorder was killed: `{file}{ending}` holds {bytes} bytes that belong to it"
                ),
                "end the recording; after a crash `sqlite3 FILE .recover` or `ros2 bag reindex` mends it",
            ));
        }
    }
    Ok(())
}

/// The path as SQLite's URI.
fn uri(path: &Path) -> String {
    let mut uri = String::from("file:");
    let absolute = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    for &byte in absolute.as_os_str().as_bytes() {
        if byte.is_ascii_alphanumeric() || b"/._-".contains(&byte) {
            uri.push(char::from(byte));
        } else {
            uri.push_str(&format!("%{byte:02X}"));
        }
    }
    uri.push_str("?immutable=1");
    uri
}
