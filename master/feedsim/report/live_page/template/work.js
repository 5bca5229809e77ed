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

class Work {
  constructor(data, module, files, given) {
    this.data = data;
    this.given = given; // setpoints that the page carries: where it does not plan
    this.unit = new Unit(module, files, data.guid);
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
    const warnings = [...machine.warnings, ...exchange_warnings(machine, this.named(state)), ...reach_warnings(machine, rows), ...limit_warnings(machine, trace)];
    return { trace, rows, segments, tasks, figures: figures_of(trace, tasks), warnings };
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
