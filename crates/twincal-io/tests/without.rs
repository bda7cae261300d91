//! A build without tables and bags names what it does not read, and still reads CSV.
#![cfg(not(any(feature = "tables", feature = "bags")))]

use twincal_io::log::{LogOptions, parse_log};
use twincal_io::model::{ModelSettings, parse_model};

#[test]
fn kinds_that_are_left_out_are_named_with_their_feature() {
    let text = r#"<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>
        <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
        <joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint></robot>"#;
    let model = parse_model("r.urdf", text.as_bytes(), &ModelSettings::default()).expect("a model");
    let (robot, _) = model.robot(&Default::default()).expect("a robot");
    let read = |bytes: &'static [u8]| parse_log("run", bytes, &robot, &LogOptions::default());
    for (bytes, feature) in [
        (&b"PAR1"[..], "`tables`"),
        (b"ARROW1", "`tables`"),
        (b"PK\x03\x04", "`tables`"),
        (b"\x89MCAP0", "`bags`"),
    ] {
        let error = read(bytes).expect_err("another build").to_string();
        assert!(error.contains(feature), "{error}");
    }
    let (log, _) = read(b"t,q1,tau1\n0,0,1\n0.1,0.1,1\n").expect("a log");
    assert_eq!(log.time.len(), 2);
}
