//! What `twincal.toml` accepts, and how it refuses the rest.

use super::*;
use twincal::calibrate::UnaskedRipple;
use twincal::prior::Inclusion;
use twincal::signal::{Auto, Payload};
use twincal::term::Family;

fn message(text: &str) -> String {
    match Config::parse("twincal.toml", text).and_then(|config| config.settings()) {
        Ok(_) => "accepted".into(),
        Err(error) => error.to_string(),
    }
}

#[test]
fn empty_config_gives_the_documented_defaults() {
    let settings = Config::parse("x", "").unwrap().settings().unwrap();
    assert_eq!(settings.calibration.signal.cutoff_hz, Auto::Auto);
    assert_eq!(settings.calibration.library.coulomb_velocity, 0.02);
    assert_eq!(settings.calibration.library.families, Family::DEFAULT);
    assert_eq!(
        (
            settings.calibration.inference.chains,
            settings.calibration.inference.draws
        ),
        (4, 5000)
    );
    assert_eq!(
        (settings.gates.rmse_ratio, settings.gates.coverage),
        (1.2, None)
    );
    assert_eq!(settings.output, PathBuf::from("twincal-out"));
    assert_eq!(settings, Config::default().settings().unwrap());
}

#[test]
fn gear_ripple_is_added_only_where_neither_families_nor_ripple_forbid_it() {
    let of = |library: &str| {
        let text = format!("[library]\n{library}\n");
        let settings = Config::parse("x", &text).unwrap().settings().unwrap();
        settings.calibration
    };
    let usual: Vec<_> = Family::DEFAULT.map(|f| format!("{:?}", f.word())).into();
    let usual = format!("families = [{}]", usual.join(", "));
    assert_eq!(of(&usual).library.families, Family::DEFAULT);
    for (library, becomes) in [
        ("", UnaskedRipple::Candidate),
        ("ripple = { elbow = 30 }", UnaskedRipple::Candidate),
        (&usual, UnaskedRipple::Told),
        ("ripple = {}", UnaskedRipple::Ignored),
    ] {
        let settings = of(library);
        assert_eq!(settings.unasked_ripple, becomes, "{library}");
        let stated = library.contains("30");
        assert_eq!(settings.library.ripple.len(), usize::from(stated));
        assert_eq!(settings.signal.every_sample, stated);
    }
}

/// The example of the contract, word for word.
const CONTRACT: &str = r#"
[model]
gravity = [0.0, 0.0, -9.81]
locked = { finger = 0.0 }
use_urdf_friction = false
[library]
terms = ["qd1^2", "qd1*qd2*cos(q2)", "sin(q1+q2)", "q2^2"]
generic = true
friction = ["viscous", "coulomb"]
offset = true
motor_inertia = true
[signal]
cutoff_hz = "auto"
rate_hz = "auto"
[prior]
slab = { scaled_variance = 1000.0 }
inclusion = { probability = 0.2 }
noise = { shape = 0.001, scale = 0.001 }
[noise]
model = "tempered"
per_joint = true
[inference]
method = "auto"
chains = 4
draws = 5000
seed = 1
[check]
rmse_ratio = 1.2
coverage = [0.90, 0.99]
"#;

#[test]
fn contract_example_is_accepted_and_means_what_it_says() {
    let settings = Config::parse("x", CONTRACT).unwrap().settings().unwrap();
    assert_eq!(settings.model.gravity, Some([0.0, 0.0, -9.81]));
    assert_eq!(settings.locked["finger"], 0.0);
    assert_eq!(settings.calibration.library.terms[1], "qd1*qd2*cos(q2)");
    assert_eq!(
        settings.calibration.prior.scaled_variance,
        Auto::Value(1000.0)
    );
    assert_eq!(
        settings.calibration.prior.inclusion,
        Some(Inclusion::Probability(0.2))
    );
    assert_eq!(settings.calibration.prior.noise, Some((0.001, 0.001)));
}

#[test]
fn zero_cutoff_makes_coulomb_the_sign_function() {
    let settings = Config::parse("x", "[signal]\ncutoff_hz = 0")
        .unwrap()
        .settings()
        .unwrap();
    assert_eq!(settings.calibration.signal.cutoff_hz, Auto::Value(0.0));
    assert_eq!(settings.calibration.library.coulomb_velocity, 0.0);
    let text = "[signal]\ncutoff_hz = 0\n[library]\ncoulomb_velocity = 0.1";
    assert_eq!(
        Config::parse("x", text)
            .unwrap()
            .settings()
            .unwrap()
            .calibration
            .library
            .coulomb_velocity,
        0.1
    );
}

/// Unless somebody says no, or states the likelihood; a stated cut-off rules it out where it is used, and is no contradiction.
#[test]
fn the_wider_band_is_the_default() {
    for (text, widens) in [
        ("", true),
        ("[signal]\nwider_band = true\ncutoff_hz = 5", true),
        ("[signal]\nwider_band = false", false),
        (
            "[signal]\nwider_band = true\n[noise]\nmodel = \"tempered\"",
            false,
        ),
        ("[noise]\nmodel = \"ar1\"", false),
    ] {
        let settings = Config::parse("x", text).unwrap().settings().unwrap();
        assert_eq!(settings.calibration.may_widen, widens, "{text}");
    }
}

#[test]
fn prior_of_families_and_forced_components() {
    let text = "[prior]\nforced = [\"elbow.viscous\"]\nfamilies = { spring = 0.5, user = 2 }\n";
    let settings = Config::parse("x", text).unwrap().settings().unwrap();
    let prior = settings.calibration.prior;
    assert_eq!(prior.families, [(Family::Spring, 0.5), (Family::User, 2.0)]);
    assert_eq!(prior.forced, ["elbow.viscous"]);
    assert_eq!(prior.heredity, None);
    let text = "[prior]\nheredity = { stribeck = \"coulomb\", \"sin(2*q2)\" = \"sin(q2)\" }\n";
    let settings = Config::parse("x", text).unwrap().settings().unwrap();
    let pair = |child: &str, parent: &str| (child.to_owned(), parent.to_owned());
    let both = vec![pair("sin(2*q2)", "sin(q2)"), pair("stribeck", "coulomb")];
    assert_eq!(settings.calibration.prior.heredity, Some(both));
    let said = message("[prior]\nfamilies = { sprong = 0.5 }\n");
    assert!(
        said.contains("no family `sprong`") && said.contains("spring"),
        "{said}"
    );
    let said = message("[prior]\nfamilies = { spring = 0 }\n");
    assert!(
        said.contains("prior.families.spring") && said.contains("positive"),
        "{said}"
    );
}

#[test]
fn case_111_unknown_key_did_you_mean() {
    for (text, expected) in [
        (
            "[signal]\ncutof_hz = 3\n",
            "twincal.toml:2:1: unknown key `cutof_hz` in [signal]; did you mean `cutoff_hz`?",
        ),
        (
            "[libary]\n",
            "twincal.toml:1:2: unknown key `libary`; did you mean `library`?",
        ),
        (
            "[prior]\nslab = { scaled_varance = 3.0 }\n",
            "twincal.toml:2:10: unknown key `scaled_varance` in [prior.slab]; did you mean `scaled_variance`?",
        ),
        (
            "[check]\nbanana = 1\n",
            "twincal.toml:2:1: unknown key `banana` in [check]; known keys: coverage, rmse_ratio",
        ),
        (
            "prior.inclusion.propability = 0.2",
            "twincal.toml:1:17: unknown key `propability` in [prior.inclusion]; did you mean `probability`?",
        ),
        ("[model]\nlocked = { any_joint = 0.0 }", "accepted"),
    ] {
        assert_eq!(message(text), expected);
    }
}

/// A config that is wrong, where its error says that it is, and words of the message.
const WRONG: [(&str, &str, &str); 20] = [
    (
        "[signal]\ncutoff_hz = true",
        "twincal.toml:2:13",
        "key `signal.cutoff_hz`: expected a number or \"auto\"",
    ),
    (
        "[signal]\ncutoff_hz = \"fast\"",
        "twincal.toml:2:13",
        "a number or \"auto\"",
    ),
    (
        "[signal]\ncutoff_hz = -1.0",
        "twincal.toml:2:13",
        "key `signal.cutoff_hz`: -1 is out of range",
    ),
    (
        "[signal]\nrate_hz = 0",
        "twincal.toml:2:11",
        "key `signal.rate_hz`: 0 is out of range",
    ),
    (
        "[library]\ncoulomb_velocity = nan",
        "twincal.toml:2:20",
        "NaN is out of range",
    ),
    (
        "[inference]\nchains = -4",
        "twincal.toml:2:10",
        "key `inference.chains`",
    ),
    (
        "[inference]\nchains = 1",
        "twincal.toml:2:10",
        "key `inference.chains`: 1 is out of range",
    ),
    (
        "[inference]\ndraws = 99",
        "twincal.toml:2:9",
        "key `inference.draws`: 99 is out of range; give a whole number from 100 to",
    ),
    (
        "[inference]\nmethod = \"exakt\"",
        "twincal.toml:2:10",
        "`exact`",
    ),
    (
        "[library]\nfriction = [\"viscos\"]",
        "twincal.toml:2:13",
        "`viscous`",
    ),
    (
        "[library]\nterms = \"q1\"",
        "twincal.toml:2:9",
        "key `library.terms`",
    ),
    (
        "[prior]\nslab = 3",
        "twincal.toml:2:8",
        "expected { scaled_variance = number } or \"auto\"",
    ),
    (
        "[prior]\ninclusion = {}",
        "twincal.toml:2:13",
        "neither key",
    ),
    (
        "[prior]\ninclusion = { probability = 0.2, expected_terms = 5 }",
        "twincal.toml:2:13",
        "both keys",
    ),
    (
        "[prior.inclusion]\nprobability = 1.0",
        "twincal.toml:2:15",
        "1 is out of range",
    ),
    (
        "[check]\ncoverage = [0.99, 0.9]",
        "twincal.toml:2:12",
        "not an interval",
    ),
    (
        "[model]\ngravity = [0.0, 1.0]",
        "twincal.toml:2:11",
        "key `model.gravity`",
    ),
    (
        "[model]\nlocked = { finger = inf }",
        "twincal.toml:2:21",
        "key `model.locked.finger`",
    ),
    ("[model\n", "twincal.toml:1:7", ""),
    (
        "[noise]\nmodel = \"iid\"\nmodel = \"ar1\"",
        "twincal.toml:3:1",
        "duplicate key",
    ),
];

#[test]
fn wrong_types_and_ranges_name_key_and_place() {
    for (text, place, words) in WRONG {
        let message = message(text);
        assert!(message.starts_with(place), "{text}\n{message}");
        assert!(message.contains(words), "{text}\n{message}");
    }
}

#[test]
fn paths_in_a_config_are_relative_to_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("twincal.toml");
    std::fs::write(
        &path,
        "[model]\nfile = \"arm.urdf\"\n[log]\nheldout = [\"b.csv\"]\n",
    )
    .unwrap();
    let config = Config::read(&path).unwrap();
    assert_eq!(config.file.model.file, Some(folder.path().join("arm.urdf")));
    assert_eq!(
        config.file.log.heldout,
        Some(vec![folder.path().join("b.csv")])
    );
}

#[test]
fn published_schema_is_current() {
    let path = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../schema/twincal.schema.json"
    );
    let published = std::fs::read_to_string(path).unwrap_or_default();
    assert!(
        published == schema(),
        "schema/twincal.schema.json is stale: write it anew with `twincal schema`"
    );
}

#[test]
fn not_utf8_and_too_large_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("c.toml");
    std::fs::write(&path, b"[model]\nfile = \"\xff\"\n").unwrap();
    assert!(
        Config::read(&path)
            .unwrap_err()
            .to_string()
            .contains("c.toml:2:9: not UTF-8")
    );
    std::fs::write(&path, vec![b'#'; SIZE_LIMIT as usize + 1]).unwrap();
    assert!(
        Config::read(&path)
            .unwrap_err()
            .to_string()
            .contains("the limit is 1048576")
    );
    assert!(
        Config::read(&folder.path().join("absent.toml"))
            .unwrap_err()
            .to_string()
            .contains("cannot read")
    );
}

#[test]
fn settings_in_force_are_the_given_keys_without_paths() {
    let text = "[model]\nfile = \"/x/a.urdf\"\n[inference]\nseed = 3\nthreads = 2\n[library]\nfriction = []\n";
    let config = Config::parse("x", text).unwrap();
    assert_eq!(
        config.in_force(),
        "[inference]\nseed = 3\n\n[library]\nfriction = []\n"
    );
    assert_eq!(Config::default().in_force(), "");
}

#[test]
fn log_is_a_table_or_one_entry_per_log() {
    let text = "[[log]]\nfile = \"a.csv\"\npayload = { mass = 1.2, com = [0.0, 0.0, 0.06] }\n\
                [[log]]\nfile = \"b.csv\"\npayload = \"unknown\"\nrate_hz = 250\nlenient = true\n\
                [[log]]\nfile = \"c.csv\"\nheldout = true\n";
    let mut config = Config::parse("x", text).unwrap();
    let log = config.settings().unwrap().log;
    assert_eq!(
        log.named(),
        [PathBuf::from("a.csv"), PathBuf::from("b.csv")]
    );
    assert_eq!(log.heldout, [PathBuf::from("c.csv")]);
    let options = |name: &str| log.options(Path::new(name));
    let known = Payload::Known {
        mass: 1.2,
        com: [0.0, 0.0, 0.06],
    };
    assert_eq!(options("a.csv").payload, known);
    let b = options("b.csv");
    assert_eq!(
        (b.payload, b.rate_hz, b.lenient),
        (Payload::Unknown, Some(250.0), true)
    );
    let other = options("d.csv");
    assert_eq!(
        (other.payload, other.rate_hz, other.lenient),
        (Payload::None, None, false)
    );
    // The report's settings say the same when they are read again; flags hold for every log.
    config.file.log.set_rate(100.0);
    let again = Config::parse("x", &config.in_force())
        .unwrap()
        .settings()
        .unwrap()
        .log;
    assert_eq!(again.options(Path::new("a.csv")).payload, known);
    assert!(
        again
            .entries
            .iter()
            .all(|entry| entry.rate_hz == Some(100.0))
    );
    assert!(again.entries[1].lenient && again.entries[2].heldout);
    // A held-out flag wins over entries.
    config.file.log.heldout = Some(vec!["e.csv".into()]);
    assert_eq!(
        config.settings().unwrap().log.heldout,
        [PathBuf::from("e.csv")]
    );
}

#[test]
fn an_entry_speaks_of_the_same_file_by_any_path() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir(folder.path().join("logs")).unwrap();
    std::fs::write(folder.path().join("logs/a.csv"), "").unwrap();
    let path = folder.path().join("twincal.toml");
    std::fs::write(
        &path,
        "[[log]]\nfile = \"logs/a.csv\"\npayload = \"unknown\"\n",
    )
    .unwrap();
    let log = Config::read(&path).unwrap().settings().unwrap().log;
    assert_eq!(log.named(), [folder.path().join("logs/a.csv")]);
    let other = folder.path().join("logs/../logs/a.csv");
    assert_eq!(log.options(&other).payload, Payload::Unknown);
    std::fs::copy(
        folder.path().join("logs/a.csv"),
        folder.path().join("a.csv"),
    )
    .unwrap();
    assert_eq!(
        log.options(&folder.path().join("a.csv")).payload,
        Payload::None
    );
}

#[test]
fn wrong_entries_and_bases_name_key_and_place() {
    for (text, place, words) in [
        (
            "[[log]]\nfile = \"a.csv\"\npaylod = 3\n",
            "twincal.toml:3:1",
            "unknown key `paylod` in [log]; did you mean `payload`?",
        ),
        (
            "[[log]]\nfile = \"a.csv\"\npayload = { mas = 1.0, com = [0, 0, 0] }\n",
            "twincal.toml:3:13",
            "unknown key `mas` in [log.payload]; did you mean `mass`?",
        ),
        (
            "[[log]]\nfile = \"a.csv\"\npayload = 1.2\n",
            "twincal.toml:3:11",
            "expected { mass = kg, com = [x, y, z] } or \"unknown\"",
        ),
        (
            "[[log]]\nfile = \"a.csv\"\npayload = { mass = -1.0, com = [0.0, 0.0, 0.0] }\n",
            "twincal.toml:3:",
            "key `log.0.payload.mass`: -1 is out of range",
        ),
        (
            "[[log]]\nfile = \"a.csv\"\n[[log]]\nfile = \"b.csv\"\nrate_hz = 0.0\n",
            "twincal.toml:5:11",
            "key `log.1.rate_hz`: 0 is out of range",
        ),
        (
            "[[log]]\nfile = \"a.csv\"\n[[log]]\nfile = \"a.csv\"\n",
            "twincal.toml:4:8",
            "`a.csv` has two entries",
        ),
        (
            "[[log]]\npayload = \"unknown\"\n",
            "twincal.toml:1:1",
            "name it with `file`",
        ),
        ("log = 3\n", "twincal.toml:1:7", "entries [[log]]"),
        (
            "[log]\nrate_hz = \"fast\"\n",
            "twincal.toml:2:11",
            "key `log.rate_hz`",
        ),
        (
            "[model]\nbase = { rpy = [0.0, inf, 0.0] }\n",
            "twincal.toml:2:16",
            "key `model.base.rpy`: inf is out of range",
        ),
        (
            "[model]\nbase = { rpi = [0.0, 0.0, 0.0] }\n",
            "twincal.toml:2:10",
            "did you mean `rpy`?",
        ),
    ] {
        let message = message(text);
        assert!(message.starts_with(place), "{text}\n{message}");
        assert!(message.contains(words), "{text}\n{message}");
    }
}

/// A flag may give what TOML has no number for; the report could not repeat it.
#[test]
fn seeds_end_where_whole_numbers_of_toml_end() {
    let mut config = Config::default();
    config.file.inference.seed = Some(i64::MAX as u64);
    config.settings().expect("the largest seed");
    assert!(config.in_force().contains("9223372036854775807"));
    config.file.inference.seed = Some(i64::MAX as u64 + 1);
    let error = config.settings().unwrap_err().to_string();
    assert!(
        error.contains("9223372036854775808 is out of range"),
        "{error}"
    );
}

/// A factor that leaves nothing is refused where it stands, whatever the joint is called.
#[test]
fn a_factor_that_leaves_nothing_is_refused_with_place_and_joint() {
    for (text, place, joint) in [
        ("[columns.factor]\nq = 0.0\n", "c.toml:2:5", "all joints"),
        (
            "[columns.factor]\nq = -1.0\ntau = { a = 2.0, elbow = nan }\n",
            "c.toml:3:26",
            "joint `elbow`",
        ),
        (
            "[columns]\nfactor.qd = { \"left.elbow\" = inf }\n",
            "c.toml:2:30",
            "joint `left.elbow`",
        ),
        (
            "[columns.factor.qdd]\nelbow = -0.0\n",
            "c.toml:2:9",
            "joint `elbow`",
        ),
    ] {
        let config = Config::parse("c.toml", text).unwrap();
        let error = config.settings().unwrap_err().to_string();
        for word in [place, joint, "columns.factor.", "such as -1.0"] {
            assert!(error.contains(word), "{word} is missing in {error}");
        }
    }
    let good = "[columns.factor]\nq = -1.0\ntau = { elbow = 0.001 }\n";
    Config::parse("c.toml", good).unwrap().settings().unwrap();
}
