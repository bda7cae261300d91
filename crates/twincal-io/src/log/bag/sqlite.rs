//! rosbag2's SQLite files (`.db3`): opened read-only and immutable, so that nothing beside the file is made or touched.

use super::definition::MAX_TEXT;
use super::joint_states::{JointStates, TopicId};
use super::mapping::Schema;
use super::mcap::{MAX_DEFINITIONS, MAX_RECORD};
use super::unpack::PackedMessages;
use crate::error::{Error, Place, Result};
use crate::open::still_leads_to;
use rusqlite::config::DbConfig;
use rusqlite::limits::Limit;
use rusqlite::{Connection, OpenFlags};
use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::rc::Rc;

/// Hands all messages of topics that are read in the file `opened`, which lies at `path`, to `sink`; `file` is what messages call it.
///
/// # Errors
/// [`Error::Content`] for files that are still being written, damaged, or no bag.
pub(super) fn read(
    opened: &File,
    path: &Path,
    file: &str,
    sink: &mut JointStates<'_>,
) -> Result<()> {
    refuse_unfinished(path, file)?;
    let broken = |e: rusqlite::Error| broken(file, &e);
    let bag = open(opened, path, file)?;
    let topics = topics(&bag, file, sink)?;
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
                "copy it again, or repair it with `ros2 bag convert`",
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

fn broken(file: &str, e: &rusqlite::Error) -> Error {
    Error::content(
        Place::file(file),
        format!("is not a whole SQLite bag: {e}"),
        "copy it again, or repair it with `ros2 bag convert`",
    )
}

/// The bag, whose tables of topics and messages hold stored values.
fn open(opened: &File, path: &Path, file: &str) -> Result<Connection> {
    let broken = |e: rusqlite::Error| broken(file, &e);
    let flags = OpenFlags::SQLITE_OPEN_READ_ONLY
        | OpenFlags::SQLITE_OPEN_URI
        | OpenFlags::SQLITE_OPEN_NO_MUTEX;
    let bag = Connection::open_with_flags(uri(path), flags).map_err(broken)?;
    // SQLite opens by path: what it opened has to be what was looked at.
    if !still_leads_to(path, opened).is_ok_and(|same| same) {
        let problem = "was replaced by another file while it was opened";
        return Err(Error::content(
            Place::file(file),
            problem,
            "read it again when nobody writes it",
        ));
    }
    let limit = i32::try_from(MAX_RECORD).unwrap_or(i32::MAX);
    bag.set_limit(Limit::SQLITE_LIMIT_LENGTH, limit)
        .map_err(broken)?;
    bag.set_db_config(DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false)
        .map_err(broken)?;
    for table in ["topics", "messages"] {
        if !is_plain_table(&bag, table).map_err(broken)? {
            return Err(Error::content(
                Place::file(file),
                format!("is a SQLite file without a table `{table}`"),
                "give a bag of rosbag2",
            ));
        }
    }
    Ok(bag)
}

/// The topics by their numbers in the bag.
fn topics(
    bag: &Connection,
    file: &str,
    sink: &mut JointStates<'_>,
) -> Result<BTreeMap<i64, TopicId>> {
    let broken = |e: rusqlite::Error| broken(file, &e);
    let mut definitions = definitions(bag).map_err(broken)?;
    let mut topics: BTreeMap<i64, TopicId> = BTreeMap::new();
    let mut query = bag
        .prepare(
            "SELECT id, substr(name, 1, 5000), substr(type, 1, 5000), substr(serialization_format, 1, 5000) \
             FROM topics ORDER BY id",
        )
        .map_err(broken)?;
    let mut rows = query.query([]).map_err(broken)?;
    while let Some(row) = rows.next().map_err(broken)? {
        let text = |column| row.get::<_, String>(column).map_err(broken);
        let (name, kind, encoding) = (text(1)?, text(2)?, text(3)?);
        let schema = (definitions.entry(kind)).or_insert_with_key(|kind| {
            Rc::new(Schema {
                kind: kind.clone(),
                ..Schema::default()
            })
        });
        let topic = sink.topic(&name, Some(schema.clone()), &encoding)?;
        topics.insert(row.get(0).map_err(broken)?, topic);
    }
    Ok(topics)
}

/// Whether there is a table of that name whose values are stored: a view, a virtual table or a computed column could compute without
/// end.
fn is_plain_table(bag: &Connection, table: &str) -> rusqlite::Result<bool> {
    let query =
        "SELECT count(*) FROM sqlite_master WHERE type = 'table' AND rootpage > 0 AND name = ?1";
    let tables: i64 = bag.query_row(query, [table], |row| row.get(0))?;
    let query = "SELECT count(*) FROM pragma_table_xinfo(?1) WHERE hidden <> 0";
    let computed: i64 = bag.query_row(query, [table], |row| row.get(0))?;
    Ok(tables == 1 && computed == 0)
}

/// What the bag says of message types; bags before ROS 2 Iron have no definitions. Those beyond all reason are left out.
fn definitions(bag: &Connection) -> rusqlite::Result<BTreeMap<String, Rc<Schema>>> {
    let mut all = BTreeMap::new();
    if !is_plain_table(bag, "message_definitions")? {
        return Ok(all);
    }
    let query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions \
                 WHERE length(encoded_message_definition) <= ?1";
    let mut query = bag.prepare(query)?;
    let limit = i64::try_from(MAX_TEXT).unwrap_or(i64::MAX);
    let mut rows = query.query([limit])?;
    let mut bytes = 0;
    while let Some(row) = rows.next()? {
        let schema = Schema {
            kind: row.get(0)?,
            language: row.get(1)?,
            text: row.get(2)?,
        };
        bytes += schema.kind.len() + schema.text.len();
        if bytes > MAX_DEFINITIONS {
            break;
        }
        // The first counts, as it always did.
        (all.entry(schema.kind.clone())).or_insert_with(|| Rc::new(schema));
    }
    Ok(all)
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
                "end the recording; after a crash `sqlite3 FILE .recover` or `ros2 bag reindex` repairs it",
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
