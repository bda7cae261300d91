//! All integration tests of `twincal` in one program, which is linked once and whose tests share the cores.

mod common;
#[path = "../examples/two_link.rs"]
#[allow(dead_code, reason = "its `main` prints, which no test needs")]
mod two_link;

mod changes;
mod claims;
mod codes_page;
mod finding_sources;
mod compare;
mod drift;
mod fleet;
mod from_statistics;
mod layers;
mod library;
mod long_logs;
mod many_logs;
mod misread;
mod payloads;
mod products;
mod properties;
mod quadratic_friction;
mod ripples;
mod robot_dynamics;
mod robot_regressor;
mod robot_rules;
mod robust;
mod size;
mod statistics;
mod statuses;
mod suites;
mod told_as;
mod turning;
mod two_link_study;
mod weak_form;
mod wider_band;
