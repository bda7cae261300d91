//! All integration tests of `twincal-cli` in one program, which is linked once and whose tests share the cores.

mod common;

mod answers;
mod artefact;
mod as_fitted;
mod bags;
mod cross_check;
mod demo;
mod diff;
mod doctor;
mod export;
mod help;
mod hostile_names;
mod hostile_sizes;
mod init;
mod inputs;
mod inspect;
mod limits;
mod one_answer;
mod overwriting;
mod printing;
mod refusals;
mod settings;
mod statistics;
mod twins;
