// Guided tours: what is wrong at first, which knobs to turn, when it is done. A lesson fits a page that has its picture and knobs.
const circle_of = held => held.evaluate.find(entry => entry.kind === "circle") && held.plane, stop_axis = held => (held.evaluate.find(entry => entry.kind === "positioning") || {}).axis;
const key_of = (axis, name) => `machine.axes.${axis}.${name}`;
const has = (held, axes, names) => axes.every(axis => names.every(name => held.knobs.some(knob => knob.key === key_of(axis, name))));
const figure_of = (view, end) => { const name = Object.keys(view.result.figures).find(entry => entry.endsWith(end) && !entry.includes("tool.") && !entry.includes("clockwise.")); return name ? view.result.figures[name][0] : null; };
const COMPENSATION = "drive.backlash_compensation.value";
const written_of = (held, end) => held.written[Object.keys(held.written).find(entry => entry.endsWith(end))][0];
const um = value => `${value.toFixed(1)} µm`;

// Of a turn: half the difference of its radii at 45° and 135°, what axes of unequal delay make.
function oblique({ result }) {
  const { angle, deviation } = contour(result.trace, result.tasks.find(entry => entry.kind === "circle").turn);
  return 1e6 * 2 * mean(deviation.map((entry, k) => entry * Math.sin(2 * angle[k])));
}

const LESSONS = [
  {
    title: "Why is this circle not round? Servo mismatch",
    fits: held => circle_of(held) && has(held, held.plane, ["drive.K_v", "drive.k_ffw"]),
    start: (held, of) => ({ [key_of(held.plane[0], "drive.k_ffw")]: 0, [key_of(held.plane[1], "drive.k_ffw")]: 0, [key_of(held.plane[1], "drive.K_v")]: 0.8 * of(key_of(held.plane[0], "drive.K_v")) }),
    turn: held => [key_of(held.plane[1], "drive.K_v")],
    text: ({ plane: [a, b] }) => [`The feedforward of both axes is off, and K_v of ${b} is a fifth below that of ${a}. Each axis lags by feed / K_v, and ${b} lags more: the circle is an ellipse that lies at 45°.`,
      `Turn K_v of ${b} until the ellipse is gone. The other direction of travel turns the ellipse the other way: axes that are not square do not do so.`],
    look: (held, view) => { const off = oblique(view); return { done: Math.abs(off) < 1, text: `The ellipse at 45° is ${um(Math.abs(off))} high; below 1 µm it is gone.` }; },
    after: "What is left is smaller than the programmed circle: both axes lag. Feedforward (k_ffw) brings the radius back.",
  },
  {
    title: "The quadrant glitch: what friction does at a reversal",
    fits: held => circle_of(held) && has(held, held.plane.slice(1), ["friction.F_C", "friction.F_S", "friction.sigma_0"]),
    start: () => ({}),
    turn: held => ["F_C", "F_S", "sigma_0"].map(name => key_of(held.plane[1], `friction.${name}`)),
    text: ({ plane: [, b] }) => [`Where ${b} reverses, its friction changes sign. The drive needs a moment to turn its torque over; meanwhile the axis stands, and the contour leaves the circle.`,
      `Halve the friction of ${b} (F_C, then F_S) and see what becomes of the glitch. Then put it back and make the bristles softer (sigma_0): the change of sign takes a longer way.`],
    look: (held, view) => { const at = figure_of(view, `.glitch_${held.plane[1]}`), first = written_of(held, `.glitch_${held.plane[1]}`);
      return { done: at < 0.6 * first, text: `The glitch where ${held.plane[1]} reverses is ${um(at)} high, at first ${um(first)}.` }; },
    after: "Less friction to turn over, a smaller glitch. On a real machine friction is what it is: the last lesson turns the drive.",
  },
  {
    title: "Compensation, and too much of it",
    fits: held => circle_of(held) && has(held, held.plane.slice(1), [COMPENSATION]),
    start: held => ({ [key_of(held.plane[1], COMPENSATION)]: 10e-6 }),
    turn: held => [key_of(held.plane[1], COMPENSATION)],
    text: ({ plane: [, b] }) => [`Somebody has seen a glitch where ${b} reverses and taken it for backlash: the control now adds half of 10 µm to the setpoint of ${b}, with the direction of its motion. The figure glitch_${b} has become smaller.`,
      `But look at the contour beside the reversals, and at G: the axis gains motion there that it has never lost, and G is larger than without. Turn the backlash compensation of ${b} back until G is as small as it was.`],
    look: (held, view) => { const b = held.plane[1], at = figure_of(view, ".G"), first = written_of(held, ".G");
      return { done: at < 1.02 * first, text: `glitch_${b} ${um(figure_of(view, `.glitch_${b}`))}, G ${um(at)}; without compensation G is ${um(first)}.` }; },
    after: "A compensation takes away what it is made for. Friction needs one of its own (docs/tuning.md), and too much of that dents the contour just so.",
  },
  {
    title: "Overshoot and ringing: a stop that is too eager",
    fits: held => stop_axis(held) && has(held, [stop_axis(held)], ["drive.T_sym"]),
    start: (held, of) => ({ [key_of(stop_axis(held), "drive.T_sym")]: 0.4 * of(key_of(stop_axis(held), "drive.T_sym")) }),
    turn: held => [key_of(stop_axis(held), "drive.T_sym")],
    text: held => [`The symmetry filter of ${stop_axis(held)} delays the setpoint of position until the feedforward has had its effect. Here it is far too short: position controller and feedforward both push, and the axis goes past its target.`,
      "Make T_sym longer until the overshoot is smallest. Beyond that it grows again on the other side: the axis comes late and creeps."],
    look: (held, view) => { const at = figure_of(view, ".overshoot"); return { done: at < 4, text: `Overshoot ${um(at)}, settled after ${figure_of(view, ".settling_time").toFixed(0)} ms.` }; },
    after: "What is left is the structure: it rings at its own frequency, whatever the filter does. A smaller jerk excites it less.",
  },
  {
    title: "Margin against glitch: what a stiffer drive costs",
    fits: held => circle_of(held) && has(held, held.plane.slice(1), ["drive.K_v", "drive.T_n", "drive.K_p"]),
    start: () => ({}),
    turn: held => ["K_v", "K_p", "T_n"].map(name => key_of(held.plane[1], `drive.${name}`)),
    text: ({ plane: [, b] }) => [`A stiffer drive turns its torque over sooner: K_v and K_p of ${b} up, T_n down, and the glitch shrinks. The open position loop below shows what that costs.`,
      `Bring the glitch of ${b} to two thirds, and keep 6 dB and 30° of margin.`],
    look: (held, view) => { const b = held.plane[1], at = figure_of(view, `.glitch_${b}`), first = written_of(held, `.glitch_${b}`), { loop } = view;
      if (!loop || loop.axis !== b || !loop.frequency.length) return { done: false, text: `The glitch where ${b} reverses is ${um(at)} high; show the frequency response of ${b} to see its margins.` };
      const dB = 20 * Math.log10(loop.gain_margin), kept = !loop.growing && dB >= 6 && loop.phase_margin >= 30;
      return { done: kept && at < 0.667 * first, text: `The glitch where ${b} reverses is ${um(at)} high, at first ${um(first)}; margins ${dB.toFixed(1)} dB and ${loop.phase_margin.toFixed(0)}°${kept ? "" : ": too little"}.` }; },
    after: "The margin is of this structure and this pose. Elsewhere the machine may be softer: docs/position-dependence.md.",
  },
];
