//! Lists of names: which joint of the model each entry of a message is.

use super::JointStates;
use crate::error::Result;
use crate::log::bag::joint_state::JointState;
use crate::log::bag::part::Part;
use std::collections::HashSet;

/// Most lists of names of one topic.
const MAX_LAYOUTS: usize = 256;
/// Words for the lists of a message.
const LISTS: [&str; 3] = ["position[]", "velocity[]", "effort[]"];

/// One list of names as it stands in messages.
pub(super) struct Layout {
    pub(super) names: Vec<u8>,
    pub(super) part: usize,
    /// Which entry of the message each joint of the part is.
    pub(super) entries: Vec<usize>,
    joints_named: usize,
}

/// Names of joints that do not move in the model.
#[derive(Default)]
pub(super) struct Foreign {
    /// As they came.
    pub(super) in_order: Vec<String>,
    names: HashSet<String>,
}

impl JointStates<'_> {
    /// Which list of names of its topic a message has, learned if it is new; `None` if the message is left out.
    pub(super) fn layout_of(
        &mut self,
        topic: usize,
        state: &JointState<'_>,
    ) -> Result<Option<usize>> {
        let names = state.names.bytes();
        let known = &self.topics[topic];
        if let Some(layout) = known.layouts.get(known.last)
            && layout.names == names
        {
            return Ok(Some(known.last));
        }
        let mut layouts = known.layouts.iter();
        match layouts.position(|layout| layout.names == names) {
            Some(at) => Ok(Some(at)),
            None => self.learn(topic, state),
        }
    }

    /// Learns a new list of names; `None` if the message is left out.
    fn learn(&mut self, topic: usize, state: &JointState<'_>) -> Result<Option<usize>> {
        let named = state.names.decode();
        if let Some(problem) = self.unusable_names(topic, &named)? {
            self.unfit(problem)?;
            return Ok(None);
        }
        if self.topics[topic].layouts.len() == MAX_LAYOUTS {
            let name = &self.topics[topic].name;
            return Err(self.refuse(
                format!("topic `{name}` has more than {MAX_LAYOUTS} different lists of names"),
                "record joint states under fixed names",
            ));
        }
        let (mut joints, mut entries) = (Vec::new(), Vec::new());
        for (joint, wanted) in self.wanted.iter().enumerate() {
            if let Some(entry) = named.iter().position(|name| name == wanted) {
                joints.push(joint);
                entries.push(entry);
            }
        }
        let wanted: HashSet<&String> = self.wanted.iter().collect();
        for name in named.iter().filter(|name| !wanted.contains(name)) {
            if self.foreign.names.insert(name.clone()) {
                self.foreign.in_order.push(name.clone());
            }
        }
        let has = state.values.map(|list| list.len() > 0);
        let part = self.part_of(topic, joints, has);
        let layouts = &mut self.topics[topic].layouts;
        layouts.push(Layout {
            names: state.names.bytes().to_vec(),
            part,
            entries,
            joints_named: named.len(),
        });
        Ok(Some(layouts.len() - 1))
    }

    /// Why nobody knows whose values a message holds: no name in it, or one that stands twice.
    fn unusable_names(&self, topic: usize, named: &[String]) -> Result<Option<String>> {
        let topic = &self.topics[topic];
        let (number, name) = (topic.messages, &topic.name);
        if named.is_empty() {
            return Ok(Some(format!(
                "message {number} on `{name}`: name[] is empty, so nobody knows whose values these are"
            )));
        }
        for joint in named {
            self.refuse_long("joint", joint)?;
        }
        let mut before = HashSet::with_capacity(named.len());
        let twice = named.iter().find(|joint| !before.insert(*joint));
        Ok(twice.map(|twice| {
            format!("message {number} on `{name}`: joint `{twice}` stands twice in name[]")
        }))
    }

    /// The part of a topic that has these joints and lists, made where there is none.
    fn part_of(&mut self, topic: usize, joints: Vec<usize>, has: [bool; 3]) -> usize {
        let same = |(part, of): (&Part, &usize)| {
            let alike = part.joints == joints && part.has[..3] == has;
            *of == topic && alike && !part.mapped
        };
        match self.parts.iter().zip(&self.part_topics).position(same) {
            Some(part) => part,
            None => {
                self.parts.push(Part::new(joints, has));
                self.part_topics.push(topic);
                self.parts.len() - 1
            }
        }
    }

    /// Which list of a message does not fit the last list of names of its topic.
    pub(super) fn misfit(&self, topic: usize, state: &JointState<'_>) -> Option<String> {
        let topic = &self.topics[topic];
        let (number, name) = (topic.messages, &topic.name);
        let layout = &topic.layouts[topic.last];
        let has = &self.parts[layout.part].has;
        for (list, words) in LISTS.iter().enumerate() {
            let found = state.values[list].len();
            let expected = if has[list] { layout.joints_named } else { 0 };
            if found == expected {
                continue;
            }
            return Some(if found == 0 || expected == 0 {
                format!(
                    "message {number} on `{name}`: {words} has {found} values, the messages before it had {expected}"
                )
            } else {
                format!(
                    "message {number} on `{name}`: {words} has {found} values for {expected} names"
                )
            });
        }
        None
    }
}
