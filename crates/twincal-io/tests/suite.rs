//! All integration tests of `twincal-io` in one program, which is linked once and whose tests share the cores.

mod common;

mod codes_page;
mod export_evaluator;
mod log_arrow;
mod log_bags;
mod log_faults;
mod log_parquet;
mod log_real;
mod log_tables;
mod model_faults;
mod model_features;
mod model_goldens;
mod one_open;
mod self_check;
