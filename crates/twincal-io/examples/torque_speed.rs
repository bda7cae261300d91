//! Seconds that `Twin::torque` takes for so many states: `torque_speed TWIN STATES`, best of five; the peer of `predict` in benches/peers/package.py.

use std::error::Error;
use std::io::Write as _;
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, states] = arguments.as_slice() else {
        return Err("usage: torque_speed TWIN STATES".into());
    };
    let twin = twincal_io::load(folder)?.twin;
    let numbers = states.parse::<usize>()? * twin.robot.dof();
    // −1…1, as the peer has them; equidistribution is all that counts here
    let signal = |start: f64| -> Vec<f64> {
        let value = |i: usize| 2.0 * ((start + 0.618_033_988_749_895 * i as f64) % 1.0) - 1.0;
        (0..numbers).map(value).collect()
    };
    let [q, qd, qdd] = [0.1, 0.4, 0.7].map(signal);
    let mut seconds = f64::INFINITY;
    for _ in 0..5 {
        let began = Instant::now();
        let torque = twin.torque(&q, &qd, &qdd)?;
        seconds = seconds.min(began.elapsed().as_secs_f64());
        assert_eq!(torque.mean.len(), numbers);
    }
    writeln!(std::io::stdout(), "{seconds:.4}")?;
    Ok(())
}
