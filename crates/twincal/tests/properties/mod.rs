//! Properties that hold for every robot, motion and posterior, on random ones (proptest; failures print their seed).

mod action;
mod answer;
mod motion;
mod robots;
