//! Steps one unit with the crate fmu-runner: `fmu-runner-program ARCHIVE STEP STEPS NAME...`
//!
//! STEP is in seconds. Writes a line for the initial values and one for each step: the named Real variables,
//! separated by commas, in as many digits as identify a number.

use fmu_runner::{fmi2Type, Fmu, FmuInstance};
use std::error::Error;
use std::io::{stdout, BufWriter, Write};

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    if words.len() < 4 {
        return Err("ARCHIVE STEP STEPS NAME... are needed".into());
    }
    let (step, steps): (f64, u32) = (words[1].parse()?, words[2].parse()?);
    let library = Fmu::unpack(&words[0])?.load(fmi2Type::fmi2CoSimulation)?;
    let unit = FmuInstance::instantiate(&library, false)?;
    let known = unit.lib.variables();
    let mut wanted = Vec::new();
    for name in &words[3..] {
        wanted.push(known.get(name).ok_or_else(|| format!("no variable {name}"))?);
    }
    unit.setup_experiment(0.0, None, None)?;
    unit.enter_initialization_mode()?;
    unit.exit_initialization_mode()?;
    let mut out = BufWriter::new(stdout().lock());
    for k in 0..=steps {
        if k > 0 {
            unit.do_step(f64::from(k - 1) * step, step, true)?;
        }
        let values = unit.get_reals(&wanted)?;
        let row: Vec<String> = wanted.iter().map(|variable| format!("{:e}", values[*variable])).collect();
        writeln!(out, "{}", row.join(","))?;
    }
    Ok(())
}
