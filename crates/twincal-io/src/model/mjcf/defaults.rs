//! MJCF default classes: an attribute that an element does not state comes from its class.

use super::super::xml::{Attribute, Document, Element, shorten};
use crate::error::Result;
use std::collections::BTreeMap;
use twincal::robot::did_you_mean;

/// Most classes of one model (each holds a copy of its parent's entries).
const MAX_CLASSES: usize = 10_000;

/// Most attributes that all classes together hold, inherited ones included.
const MAX_STATED: usize = 1_000_000;

/// Where an attribute was stated; the last of a list is the most specific.
type Stated<'a> = Vec<(&'a Element, &'a Attribute)>;
/// Attributes by element name, then attribute name.
type Entries<'a> = BTreeMap<&'a str, BTreeMap<&'a str, Stated<'a>>>;

/// All classes by name, each with what it inherits.
#[derive(Debug, Default)]
pub(super) struct Defaults<'a> {
    classes: BTreeMap<&'a str, Entries<'a>>,
    main: &'a str,
}

/// Elements of `<actuator>`: their defaults are one and the same in MuJoCo.
const ACTUATORS: [&str; 14] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "orientation",
    "pid",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "plugin",
    "sitepos",
];

fn kind(name: &str) -> &str {
    if ACTUATORS.contains(&name) {
        "actuator"
    } else {
        name
    }
}

/// Attributes of a class.
fn size(entries: &Entries<'_>) -> usize {
    let attributes = entries.values().flat_map(BTreeMap::values);
    attributes.map(Vec::len).sum()
}

impl<'a> Defaults<'a> {
    /// Reads all `<default>` sections under the root.
    ///
    /// # Errors
    /// For a nested class without a name and too many classes.
    pub(super) fn read(document: &'a Document, root: &'a Element) -> Result<Self> {
        let mut defaults = Self {
            classes: BTreeMap::new(),
            main: "main",
        };
        defaults.classes.insert("main", Entries::new());
        let mut stated = 0;
        for (number, section) in document.children(root, "default").enumerate() {
            if let Some(name) = section.text("class")
                && number == 0
            {
                defaults.classes = BTreeMap::from([(name, Entries::new())]);
                defaults.main = name;
            }
            let mut open: Vec<(&'a Element, &'a str)> = vec![(section, defaults.main)];
            while let Some((element, name)) = open.pop() {
                let mut entries = defaults.classes.get(name).cloned().unwrap_or_default();
                let nested = add_stated(document, element, &mut entries);
                stated += (1 + nested.len()) * size(&entries);
                if stated > MAX_STATED {
                    return Err(document.error(
                        element,
                        format!("default classes hold more than {MAX_STATED} attributes"),
                        "no robot needs this: is it the right file?",
                    ));
                }
                for child in nested.into_iter().rev() {
                    let Some(class) = child.text("class").filter(|c| !c.is_empty()) else {
                        return Err(document.error(
                            child,
                            "a nested <default> has no class",
                            "name it: class=\"…\"",
                        ));
                    };
                    defaults
                        .classes
                        .entry(class)
                        .or_insert_with(|| entries.clone());
                    if defaults.classes.len() > MAX_CLASSES {
                        return Err(document.error(
                            child,
                            format!("more than {MAX_CLASSES} default classes"),
                            "no robot needs this: is it the right file?",
                        ));
                    }
                    open.push((child, class));
                }
                defaults.classes.insert(name, entries);
            }
        }
        Ok(defaults)
    }

    /// An element seen through its class: its own `class`, else `childclass`, else the main one.
    ///
    /// # Errors
    /// When the class does not exist.
    pub(super) fn view<'v>(
        &'v self,
        document: &'a Document,
        element: &'a Element,
        childclass: Option<&str>,
    ) -> Result<View<'a, 'v>> {
        let class = element.text("class").or(childclass).unwrap_or(self.main);
        match self.classes.get(class) {
            Some(entries) => Ok(View {
                document,
                element,
                entries: entries.get(kind(&element.name)),
            }),
            None => Err(document.error(
                element,
                format!(
                    "<{}> uses default class `{}`, which does not exist",
                    element.name,
                    shorten(class)
                ),
                did_you_mean(class, self.classes.keys().copied()),
            )),
        }
    }
}

/// Adds what a class states to its entries; the classes that are nested in it.
fn add_stated<'a>(
    document: &'a Document,
    class: &'a Element,
    entries: &mut Entries<'a>,
) -> Vec<&'a Element> {
    let mut nested = Vec::new();
    for &child in &class.children {
        let child = &document.elements[child];
        if child.name == "default" {
            nested.push(child);
            continue;
        }
        let by_attribute = entries.entry(kind(&child.name)).or_default();
        for attribute in &child.attributes {
            by_attribute
                .entry(&attribute.name)
                .or_default()
                .push((child, attribute));
        }
    }
    nested
}

/// An element with the attributes that its class adds.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a, 'v> {
    pub(super) document: &'a Document,
    pub(super) element: &'a Element,
    entries: Option<&'v BTreeMap<&'a str, Stated<'a>>>,
}

impl<'a> View<'a, '_> {
    /// An element without a class.
    pub(super) fn plain(document: &'a Document, element: &'a Element) -> Self {
        Self {
            document,
            element,
            entries: None,
        }
    }

    /// The element or default in which the attribute stands, and the attribute.
    pub(super) fn get(&self, name: &str) -> Option<(&'a Element, &'a Attribute)> {
        self.element
            .get(name)
            .map(|a| (self.element, a))
            .or_else(|| self.stated(name).last().copied())
    }

    /// Class entries of an attribute, most general first (without the element's own).
    pub(super) fn stated(&self, name: &str) -> &[(&'a Element, &'a Attribute)] {
        self.entries
            .and_then(|e| e.get(name))
            .map_or(&[], Vec::as_slice)
    }

    /// Text of an attribute.
    pub(super) fn text(&self, name: &str) -> Option<&'a str> {
        self.get(name).map(|(_, a)| a.value.as_str())
    }

    /// Exactly `N` numbers of an attribute.
    pub(super) fn numbers<const N: usize>(&self, name: &str) -> Result<Option<[f64; N]>> {
        self.get(name)
            .map(|(element, attribute)| self.document.exactly(element, attribute))
            .transpose()
    }

    /// One number.
    pub(super) fn number(&self, name: &str) -> Result<Option<f64>> {
        Ok(self.numbers::<1>(name)?.map(|[value]| value))
    }

    /// The first number of a list whose further numbers must be 0 (MuJoCo's higher polynomial coefficients).
    pub(super) fn linear(&self, name: &str) -> Result<f64> {
        let Some((element, attribute)) = self.get(name) else {
            return Ok(0.0);
        };
        match self.document.number_list(element, attribute)?[..] {
            [] => Ok(0.0),
            [first, ref higher @ ..] if higher.iter().all(|&v| v == 0.0) => Ok(first),
            _ => Err(self.document.attribute_error(
                element,
                attribute,
                format!(
                    "<{}> {name}=\"{}\" is a polynomial",
                    element.name,
                    shorten(&attribute.value)
                ),
                "twincal's nominal torque has linear stiffness and damping only: give one number",
            )),
        }
    }

    /// `true`/`false` (anything else, as `auto`, is `None`).
    pub(super) fn flag(&self, name: &str) -> Option<bool> {
        match self.text(name)? {
            "true" => Some(true),
            "false" => Some(false),
            _ => None,
        }
    }
}
