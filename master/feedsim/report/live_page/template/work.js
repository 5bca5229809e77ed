// What the page asks for: a state of the knobs -> setpoints, a run, figures, warnings. Runs in a worker, and in tests in node.

// Motions and parameters of a state: values of the knobs, in the order of data.knobs, SI.
function applied(data, state) {
  const motions = structuredClone(data.motions), own = new Map(data.parameters.map(entry => [entry[0], entry]));
  data.knobs.forEach((knob, k) => {
    const value = knob.choices.length && knob.sets.length ? Number(state[k] === "true") : state[k];
    for (const [reference, kind, name, factor] of knob.sets) if (own.has(reference) || state[k] !== knob.value) own.set(reference, [reference, kind, value * factor, name]);
    if (knob.motion.length) {
      const [index, ...path] = knob.motion, last = path.pop();
      path.reduce((part, name) => part[name], motions[index])[last] = state[k];
    }
  });
  return { motions, parameters: [...own.values()] };
}

// Of the loops' response to friction: frequencies up to this [Hz], and up to this multiple of the circle's.
const DRAG = { HIGHEST: 200, MOST: 401 };
// Harmonics of errors that repeat with the pitch, beyond z of cos(z cos t), in cube roots of z.
const PITCH_HARMONICS = 4;

class Work {
  constructor(data, module, files, given) {
    this.data = data;
    this.given = given; // setpoints that the page carries: where it does not plan
    this.unit = new Unit(module, files, data.guid);
    const { machine } = data, table = name => machine.modes[name] ? machine.modes[name] : mode_table(new TextDecoder().decode(files["modes.csv"]), machine.axes);
    this.plant = new ModalPlant(table("pose"), machine.cycles.T_c);
    this.judged_plant = machine.modes.table ? new ModalPlant(table("table"), machine.cycles.T_c) : this.plant;
  }

  // Drives and structure of a state as one linear system.
  linear(state, plant = this.plant) {
    return new LinearSystem(this.data.machine, this.named(state), plant);
  }

  // Values of a state by the parameter's name; of friction all that the axis has, wherever it acts.
  named(state) {
    const { knobs, machine } = this.data, own = new Map(applied(this.data, state).parameters.map(([, , value, name]) => [name, value]));
    for (const name in machine.friction) {
      const k = knobs.findIndex(knob => knob.key === `machine.axes.${name}`);
      own.set(name, k < 0 ? machine.friction[name] : state[k]);
    }
    return name => own.get(name);
  }

  async run(state, between) {
    const { data } = this, { machine } = data, { T_c, T_pos } = machine.cycles, { motions, parameters } = applied(data, state);
    const wide = 2 * machine.axes.length, { rows, segments, problems } = plan(machine, motions, this.given);
    if (problems.length) throw new Error(problems.join("\n"));
    const duration = (rows.length / wide - 1) * T_pos, tasks = tasks_of(data.evaluate, segments, duration);
    const result = await this.unit.run({ parameters, feeds: machine.feeds, rows, ratio: Math.round(T_pos / T_c), every: machine.every, T_c,
      reals: machine.signals.map(name => machine.references[name][0]), flags: machine.axes.flatMap(axis => machine.flags.map(flag => machine.references[`${axis}.${flag}`][0])) }, between);
    if (!result) return null;
    const trace = { time: result.time }, names = [...machine.signals, ...machine.axes.flatMap(axis => machine.flags.map(flag => `${axis}.${flag}`))];
    names.forEach((name, k) => { trace[name] = result.columns[k]; });
    return { trace, rows, segments, tasks, figures: figures_of(trace, tasks), warnings: limit_warnings(machine, trace) };
  }

  // Why the circles of a run are not round.
  causes(state, { trace, tasks, figures }) {
    const { machine } = this.data, system = this.linear(state), gain = {}, drag = {}, following = {}, circle = tasks.find(entry => entry.kind === "circle");
    if (!circle) return {};
    const first = 1 / (circle.turn.end - circle.turn.begin), highest = Math.max(2, Math.min(DRAG.HIGHEST / first, 0.4 / machine.cycles.T_c / first, DRAG.MOST));
    const kept = [], at = k => kept[k] ||= system.position_loops(k * first), loops = Array.from({ length: Math.ceil((highest - 1) / 2) }, (_, k) => at(2 * k + 1));
    for (const axis of circle.axes) {
      gain[axis] = system.position_reference(axis, loops[0]);
      drag[axis] = loops.map(entry => system.drag(axis, entry));
      const waves = circle.turn.radius / machine.I_P[axis], count = Math.max(1, Math.floor(Math.min(waves + PITCH_HARMONICS * (1 + Math.cbrt(waves)), 0.4 / machine.cycles.T_c / first, 500)));
      following[axis] = Array.from({ length: count }, (_, k) => system.following(axis, at(k + 1)));
    }
    return causes_of(trace, tasks, figures, { pitch: Object.fromEntries(machine.axes.map(axis => [axis, 2 * Math.PI * machine.I_P[axis]])), gain, drag, following, students: machine.students });
  }

  // All that a run warns of; null where the newest knob has ended it.
  async warnings(state, result, between) {
    const { machine } = this.data, system = this.linear(state, this.judged_plant);
    const loops = await judge(system, machine.locked, between);
    return loops && [...machine.warnings, ...loop_warnings(loops), ...exchange_warnings(machine, this.named(state), this.judged_plant.table), ...reach_warnings(machine, result.rows), ...result.warnings];
  }

  bode(state, axis, between) {
    return bode(this.unit, this.data.machine, applied(this.data, state).parameters, axis, between);
  }
}

async function work_of(data) {
  const files = {};
  for (const name in data.files) files[name] = await unpacked(data.files[name]);
  const given = data.given && { segments: data.given.segments, rows: new Float64Array((await unpacked(data.given.rows)).buffer) };
  return new Work(data, await unpacked(data.module), files, given);
}
