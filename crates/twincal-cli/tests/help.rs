//! Help texts and error messages as they stand on a terminal of 80 columns.
#![allow(clippy::unwrap_used, reason = "a broken test may panic")]

use crate::common;
use crate::common::{fitted, folder, run};

fn narrow(text: &str) -> &str {
    for line in text.lines() {
        assert!(
            line.chars().count() <= 80,
            "{} columns: {line}",
            line.chars().count()
        );
    }
    text
}

#[test]
fn help_leads_with_examples() {
    for verb in [
        "",
        "demo",
        "inspect",
        "doctor",
        "init",
        "fit",
        "check",
        "predict",
        "export",
        "report",
        "completions",
        "schema",
    ] {
        let arguments = [verb, "-h"].into_iter().filter(|word| !word.is_empty());
        let done = run(folder().path(), arguments).expect(0);
        assert!(done.out.starts_with("Example"), "{}", done.out);
        insta::assert_snapshot!(format!("help_{verb}"), narrow(&done.out));
    }
}

#[test]
fn messages_name_the_culprit_and_the_remedy() {
    let folder = folder();
    std::fs::write(
        folder.path().join("bad.toml"),
        "[prior]\nslab = { scaled_varance = 3 }\n",
    )
    .unwrap();
    std::fs::write(
        folder.path().join("bad.csv"),
        "t,q1,q2,tau1,tau2\n0,0,0,0,x\n",
    )
    .unwrap();
    let lines = [
        "fti",
        "fit",
        "fit run.csv",
        "fit run.csv --model arm.urdf --config bad.toml",
        "fit bad.csv --model arm.urdf",
        "fit absent.csv --model arm.urdf",
        "fit run.csv --model absent.urdf",
        "fit run.csv --model arm.urdf --sed 3",
        "check run.csv --twin absent",
        "predict run.csv --twin absent -o p.txt",
    ];
    let said: String = lines
        .iter()
        .map(|line| {
            let done = run(folder.path(), line.split(' ')).expect(2);
            assert!(done.out.is_empty(), "{}", done.out);
            format!("$ twincal {line}\n{}\n", done.err)
        })
        .collect();
    insta::assert_snapshot!(said);
}

#[test]
fn summaries_fit_eighty_columns() {
    let folder = common::fitted_copy();
    let done = common::fit(folder.path(), &["-o", "out"]).expect(0);
    narrow(&done.out);
    for (arguments, code) in [
        (["check", "run.csv", "--twin", "twin"], 0),
        (["inspect", "run.csv", "--model", "arm.urdf"], 0),
        (["doctor", "run.csv", "--model", "arm.urdf"], 0),
    ] {
        narrow(&run(folder.path(), arguments).expect(code).out);
    }
    assert!(fitted().join("twin").exists());
}
