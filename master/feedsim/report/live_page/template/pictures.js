// What a run looks like, as charts of reports (feedsim.report.chart): drawn by the same script as those of every report.
const LOOK = { dash: "", width: 1.4, dots: false, faint: false, filled: false, ascending: true };
let arrays_made = 0;

// An array for chart_use.js; it is known by its number until the chart is made anew.
function pooled(values) {
  arrays.set(--arrays_made, values);
  return arrays_made;
}
const forget = chart => JSON.stringify(chart, (key, value) => { if ((key === "x" || key === "y") && value < 0) arrays.delete(value); return value; });

const curve = (name, x, y, colour, look = {}) => ({ ...LOOK, name, x: pooled(x), y: pooled(y), colour, ...look });
const level = (at, text = "", look = {}) => ({ at, text, upright: false, colour: "muted", dash: "dashed", ends: null, ...look });
const axis_of = (label, unit, look = {}) => ({ label, unit, log: false, span: null, names: [], ...look });
const mark = (x, y, text, colour = "vermillion") => ({ x, y, text, colour, hollow: false });
const panel = (title, x, y, curves, more = {}) => ({ kind: "xy", title, x, y, curves, levels: [], bands: [], marks: [], linked: "", note: "", height: 1, ...more });
const TIME = axis_of("time", "s"), ZERO = level(0, "", { dash: "" }), COLOURS = ["blue", "vermillion", "green", "purple", "orange", "sky"];
const KEPT = { colour: "ink", dash: "dotted", width: 1.3 };

// Rows that a curve needs at most: of each bin of the others its extremes.
function thinned(x, y, most = 3000) {
  if (x.length <= most) return [x, y];
  const width = Math.ceil(x.length / (most / 2)), rows = new Set([0, x.length - 1]);
  for (let k = 0; k < x.length; k += width) {
    let low = k, high = k;
    for (let i = k; i < Math.min(k + width, x.length); i++) { if (y[i] < y[low]) low = i; if (y[i] > y[high]) high = i; }
    rows.add(low).add(high);
  }
  const kept = [...rows].sort((a, b) => a - b);
  return [kept.map(k => x[k]), kept.map(k => y[k])];
}
const over = (name, x, y, colour, look) => curve(name, ...thinned(x, y), colour, look);

function ring_step(most) {
  if (most >= 2 && most <= 20) return 10;
  const decade = 10 ** Math.floor(Math.log10(Math.max(most, 0.1)));
  return [1, 2, 5, 10].map(entry => entry * decade).find(entry => Math.max(most, 0.1) <= 1.5 * entry);
}

// The height at a reversal is the figure glitch_X+ and so on, the larger one where both directions are driven.
function contour_chart(task, result, kept) {
  const { turn, back } = task, seen = contour(result.trace, turn), curves = [], unrolled = [];
  const draw = (name, measured, colour, look = {}) => {
    const y = measured.deviation.map(entry => entry * 1e6), degrees = measured.angle.map(entry => modulo(entry * 180 / Math.PI, 360));
    curves.push(curve(name, measured.angle, y, colour, { ascending: false, ...look }));
    const order = Array.from(degrees.keys()).sort((a, b) => degrees[a] - degrees[b]);
    unrolled.push(curve(name, order.map(k => degrees[k]), order.map(k => y[k]), colour, look));
  };
  if (kept) draw("kept", contour(kept.trace, kept.tasks.find(entry => entry.prefix === task.prefix).turn), KEPT.colour, KEPT);
  draw("tool point", contour(result.trace, turn, turn.axes.map(axis => `tcp.x_${axis}`)), "orange", { dash: "dashed", width: 1.2 });
  const words = sense => back ? `linear scales, ${sense > 0 ? "counterclockwise" : "clockwise"}` : "linear scales";
  const hue = sense => back && sense < 0 ? "wine" : "blue";
  draw(words(turn.sense), seen, hue(turn.sense), { width: 1.6 });
  if (back) draw(words(back.sense), contour(result.trace, back), hue(back.sense), { dash: "dashed", width: 1.2 });
  const most = largest(seen.deviation.map(Math.abs)) * 1e6, ring = ring_step(most);
  const marks = seen.glitches.map(({ name, angle, deviation }, quarter) => {
    // The largest deviation at the border of its quadrant is the shape's, no peak behind a reversal.
    if (Math.abs(modulo(angle - quarter * Math.PI / 2 + Math.PI, 2 * Math.PI) - Math.PI) > 40 / 180 * Math.PI) return null;
    const directions = [contour(result.trace, turn), ...back ? [contour(result.trace, back)] : []], height = largest(directions.map(entry => entry.glitches.find(other => other.name === name).height));
    return mark(angle, deviation * 1e6, `${name.replace("-", "−")}: ${fixed(height * 1e6, 2)} µm`);
  }).filter(Boolean);
  return { widths: [1.2, 1], panels: [
    { kind: "polar", title: `Contour error, ${turn.axes.join("-")}, R ${number(turn.radius * 1e3)} mm`, axes: turn.axes, radius: turn.radius * 1e3, ring, rings: most < 1.1 * ring ? 1 : 2, curves, marks,
      sense: back ? 0 : turn.sense, note: "" },
    panel("Over the angle", axis_of(`angle from ${turn.axes[0]}+`, "°", { span: [0, 360] }), axis_of("radius deviation", "µm"), unrolled, {
      levels: [ZERO, level(seen.median * 1e6, "median (scales)", { dash: "dotted" })], marks: marks.map(entry => ({ ...entry, x: modulo(entry.x * 180 / Math.PI, 360), text: "" })), linked: "angle" }),
  ] };
}

function torque_chart(task, result, kept, signs) {
  const panels = [];
  for (const axis of task.axes) {
    const sign = signs[axis], part = trace => { const [a, b] = rows_within(trace.time, task.turn.begin, task.turn.end); return name => trace[name].slice(a, b + 1); };
    const now = part(result.trace), speed = now(`${axis}.n_a`), torque = name => now(name).map(entry => sign * entry), near = 0.12 * (largest(speed.map(Math.abs)) || 1);
    const both = (x, look) => [over("motor M_a", x, torque(`${axis}.M_a`), "blue", { width: 1.2, ...look }), over("friction M_fr", x, torque(`${axis}.M_fr`), "purple", { width: 1.2, ...look })];
    const y = axis_of(sign > 0 ? "torque" : "torque, sign reversed", "N·m"), n_a = axis_of("motor speed n_a", "rad/s"), loops = () => {
      const result = [curve("motor M_a", speed, torque(`${axis}.M_a`), "blue", { width: 1.2, ascending: false }), curve("friction M_fr", speed, torque(`${axis}.M_fr`), "purple", { width: 1.2, ascending: false })];
      if (kept) { const before = part(kept.trace); result.unshift(curve("kept", before(`${axis}.n_a`), before(`${axis}.M_fr`).map(entry => sign * entry), KEPT.colour, { ...KEPT, ascending: false })); }
      return result;
    };
    const zeros = [ZERO, level(0, "", { dash: "", upright: true })];
    panels.push(panel(`Axis ${axis}: torque over time`, TIME, y, both(result.trace.time.slice(...rows_of(result.trace, task.turn))), { levels: [ZERO], linked: "t" }),
      panel("Torque over speed", n_a, y, loops(), { levels: zeros }), panel("Friction around the reversal", { ...n_a, span: [-near, near] }, y, loops().filter(entry => entry.name !== "motor M_a"), { levels: zeros }));
  }
  return { widths: [1.25, 1, 1], panels };
}
const rows_of = (trace, turn) => { const [a, b] = rows_within(trace.time, turn.begin, turn.end); return [a, b + 1]; };

function stop_chart(task, result, kept, signs) {
  const { axis } = task, { trace, figures } = result, [a, b] = stop_rows(trace.time, task), t = trace.time.slice(a, b), sign = signs[axis], of = (name, factor = 1) => trace[name].slice(a, b).map(entry => factor * entry);
  const end = level(task.end, "end of NC motion", { upright: true, dash: "dotted" }), past = (source, of_task, name, signal, colour, look) => { const seen = beyond(source, of_task, signal); return over(name, seen.time.map(entry => (entry - of_task.end) * 1e3), seen.y.map(entry => entry * 1e6), colour, look); };
  const figure = name => figures[`${task.prefix}.${name}`][0], band = task.band * 1e6, curves = [], marks = [], own = beyond(trace, task, `${axis}.x_a`);
  if (kept) curves.push(past(kept.trace, kept.tasks.find(entry => entry.prefix === task.prefix), "kept", `${axis}.x_a`, KEPT.colour, KEPT));
  curves.push(past(trace, task, "tool point", `tcp.x_${axis}`, "orange", { dash: "dashed" }), past(trace, task, "linear scale x_a", `${axis}.x_a`, "blue"));
  if (figure("overshoot") > 0) marks.push(mark((own.time[own.y.indexOf(largest(own.y))] - task.end) * 1e3, figure("overshoot"), `overshoot ${fixed(figure("overshoot"), 2)} µm`, "blue"));
  const most = Math.max(2.2 * band, ...[figure("overshoot"), figure("tool.overshoot")].filter(Number.isFinite)), last = Math.min(0.4, Math.max(task.until - task.end, 0.05)) * 1e3, settled = figure("settling_time");
  return { widths: [1], panels: [
    panel(`Position of axis ${axis}`, TIME, axis_of("position", "mm"), [over("linear scale x_a", t, of(`${axis}.x_a`, 1e3), "blue")], { levels: [end], linked: "t" }),
    panel("Distance beyond the target", axis_of("time after the end of the NC motion", "ms", { span: [-30, last] }), axis_of(task.sense > 0 ? "beyond the target" : "beyond the target, to minus", "µm", { span: [-1.45 * most, 1.45 * most] }), curves, {
      levels: [ZERO, level(0, "", { upright: true, dash: "dotted" })], bands: [{ name: "", x: null, low: -band, high: band, colour: "green" }], marks, height: 1.15,
      note: Number.isNaN(settled) ? "settling time not determined" : `settled to ±${number(band)} µm after ${fixed(settled, 1)} ms` }),
    panel(`Driving torque of axis ${axis}${sign < 0 ? ", sign reversed" : ""}`, TIME, axis_of("torque", "N·m"), [over("motor torque M_a", t, of(`${axis}.M_a`, sign), "blue"), over("friction torque M_fr", t, of(`${axis}.M_fr`, sign), "purple", { width: 1.2 })], { levels: [end, ZERO], linked: "t" }),
  ] };
}

function following_chart(axes, result, kept) {
  const { trace } = result, rows = (name, colours, factor, source, look) => axes.map((axis, k) => over(look ? `kept, axis ${axis}` : `axis ${axis}`, source.time, source[`${axis}.${name}`].map(entry => factor * entry), colours(k), look || { width: 1.2 }));
  const colours = k => COLOURS[k % COLOURS.length];
  return { widths: [1], panels: [
    panel("Following error", TIME, axis_of("following error", "µm"), [...(kept ? rows("x_e", colours, 1e6, kept.trace, { dash: "dotted", width: 1.1 }) : []), ...rows("x_e", colours, 1e6, trace)], { levels: [ZERO], linked: "t" }),
    panel("Motor torque", TIME, axis_of("torque", "N·m"), rows("M_a", colours, 1, trace), { levels: [ZERO], linked: "t", height: 0.8 }),
  ] };
}

function bode_chart(loop, kept) {
  const f = axis_of("frequency", "Hz", { log: true }), axis = `axis ${loop.axis}`, levels = [level(0, "", { dash: "" })], under = [level(-180, "−180°")];
  if (loop.gain_at) levels.push(level(loop.gain_at, `gain margin ${fixed(20 * Math.log10(loop.gain_margin), 1)} dB`, { upright: true }));
  if (loop.phase_at) under.push(level(loop.phase_at, `phase margin ${fixed(loop.phase_margin, 0)}°`, { upright: true }));
  const shown = (name, entry) => [...(kept && kept.frequency.length ? [curve("kept", kept.frequency, kept[entry], KEPT.colour, KEPT)] : []), curve(name, loop.frequency, loop[entry], "blue")];
  return { widths: [1, 1], panels: [
    panel("Gain of the open position loop", f, axis_of("gain", "dB"), shown(axis, "gain"), { levels, linked: "f" }),
    panel("Phase of the open position loop", f, axis_of("phase", "°"), shown(axis, "phase"), { levels: under, linked: "f" }),
  ] };
}
