// The position loop of an axis by an experiment on the machine in this page: friction off, one setpoint 1 um off its place for a
// position cycle, other loops as they are. The gain of the loop is x_a over x_e, as both are sampled.
const KICK = 1e-6, LONGEST_RING = 4, STILL = 1e-7, POINTS = 240, HALVINGS = 24;

// Positions and following error every T_pos after an impulse at the setpoint of `axis`; slower: by what K_v is divided.
async function kicked(unit, machine, parameters, axis, slower, between) {
  const { T_c, T_pos } = machine.cycles, ratio = Math.round(T_pos / T_c), wide = 2 * machine.axes.length, count = Math.round(LONGEST_RING / T_pos) + 1;
  const rows = new Float64Array(count * wide), i = machine.axes.indexOf(axis), own = new Map(parameters.map(entry => [entry[0], entry]));
  const put = (name, value) => { const [reference, kind] = machine.references[name]; own.set(reference, [reference, kind, value]); };
  for (let n = 0; n < count; n++) machine.axes.forEach((entry, j) => { rows[n * wide + 2 * j] = machine.pose[entry]; });
  rows[wide * 2 + 2 * i] += KICK;
  put("coupling.friction", false);
  for (const entry of machine.axes) put(`${entry}.M_0`, 0);
  const K_v = `${axis}.drive.K_v`;
  put(K_v, own.get(machine.references[K_v][0])[2] / slower);
  const reals = ["x_a", "x_e"].map(name => machine.references[`${axis}.${name}`][0]);
  return unit.run({ parameters: [...own.values()], feeds: machine.feeds, rows, ratio, every: ratio, T_c, reals, flags: [] }, between);
}

const reach = (values, origin, from, to) => { let most = 0; for (let k = Math.floor(from); k < to; k++) most = Math.max(most, Math.abs(values[k] - origin)); return most; };

// Whether what an impulse leaves grows: it is more in the last quarter than in the one before.
function grows(x, origin) {
  const n = x.length, late = reach(x, origin, 0.75 * n, n);
  return !Number.isFinite(late) || (late > reach(x, origin, 0.5 * n, 0.75 * n) && late > STILL * KICK * 100);
}

function spectrum(values, origin, shift, cycle, omega) {
  const c = Math.cos(omega * cycle), s = -Math.sin(omega * cycle);
  let re = 0, im = 0, a = 1, b = 0;
  for (let k = shift; k < values.length; k++) {
    const value = values[k] - origin;
    re += value * a;
    im += value * b;
    [a, b] = [a * c - b * s, a * s + b * c];
  }
  return [re, im];
}

// {frequency, gain [dB], phase [deg, unwrapped], margins, growing}; null where the newest knob has ended it.
async function bode(unit, machine, parameters, axis, between) {
  const { T_pos } = machine.cycles, origin = machine.pose[axis];
  let slower = 1, seen = null, growing = false;
  for (const tried of [1, 8, 64]) {
    try { seen = await kicked(unit, machine, parameters, axis, slower = tried, between); } catch (error) { seen = { columns: [[NaN], [0]] }; }
    if (seen === null) return null;
    const bad = grows(seen.columns[0], origin);
    if (tried === 1) growing = bad;
    if (!bad) break;
    if (tried === 64) return { axis, growing: true, frequency: [], gain: [], phase: [], real: [], imaginary: [] };
  }
  const [x_a, x_e] = seen.columns, high = 0.5 / T_pos * 0.98, low = 2;
  const frequency = Array.from({ length: POINTS }, (_, k) => low * (high / low) ** (k / (POINTS - 1))), gain = [], phase = [], real = [], imaginary = [];
  const loop_at = f => {
    const omega = 2 * Math.PI * f, [a, b] = spectrum(x_a, origin, 0, T_pos, omega), [c, d] = spectrum(x_e, 0, 1, T_pos, omega), size = c * c + d * d;
    // x_e as it is sampled shows a position cycle later
    return [slower * (a * c + b * d) / size, slower * (b * c - a * d) / size];
  };
  let last = 0;
  for (const f of frequency) {
    const L = loop_at(f);
    let angle = Math.atan2(L[1], L[0]) * 180 / Math.PI;
    if (phase.length) angle += 360 * Math.round((last - angle) / 360); else if (angle > 0) angle -= 360;
    real.push(L[0]);
    imaginary.push(L[1]);
    gain.push(20 * Math.log10(Math.hypot(...L)));
    phase.push(last = angle);
  }
  return { axis, growing, frequency, gain, phase, real, imaginary, ...margins(loop_at, frequency, gain, imaginary) };
}

// Margins as feedsim.linear.margins defines them; loop(f) is the gain [re, im], the curve finds the brackets.
function margins(loop, frequency, gain, imaginary) {
  let gain_margin = Infinity, gain_at = NaN, phase_margin = NaN, phase_at = NaN, crossover = NaN;
  const crossing = (k, value) => {
    let low = frequency[k], high = frequency[k + 1];
    const below = value(loop(low)) < 0;
    for (let n = 0; n < HALVINGS; n++) {
      const middle = (low + high) / 2;
      if ((value(loop(middle)) < 0) === below) low = middle; else high = middle;
    }
    return (low + high) / 2;
  };
  for (let k = 0; k + 1 < frequency.length; k++) {
    if ((imaginary[k] < 0) !== (imaginary[k + 1] < 0)) {
      const f = crossing(k, entry => entry[1]), [re] = loop(f);
      if (re < 0 && -1 / re > 1 && -1 / re < gain_margin) { gain_margin = -1 / re; gain_at = f; }
    }
    if ((gain[k] < 0) !== (gain[k + 1] < 0)) {
      const f = crossing(k, entry => Math.hypot(...entry) - 1), [re, im] = loop(f), left = Math.atan2(-im, -re) * 180 / Math.PI;
      if (Number.isNaN(crossover)) crossover = f;
      if (!(Math.abs(left) >= Math.abs(phase_margin))) { phase_margin = left; phase_at = f; }
    }
  }
  return { gain_margin, gain_at, phase_margin, phase_at, crossover };
}
