// What the page asks for: a state of the knobs -> setpoints, a run, figures, warnings. Runs in a worker, and in tests in node.

// Motions and parameters of a state: values of the knobs, in the order of data.knobs, SI.
function applied(data, state) {
  const motions = structuredClone(data.motions), own = new Map(data.parameters.map(each => [each[0], each]));
  data.knobs.forEach((knob, k) => {
    for (const [reference, kind] of knob.sets || []) own.set(reference, [reference, kind, state[k]]);
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

  async run(state, between) {
    const { data } = this, { machine } = data, { T_c, T_pos } = machine.cycles, { motions, parameters } = applied(data, state);
    const wide = 2 * machine.axes.length, { rows, segments, problems } = plan(machine, motions, this.given);
    if (problems.length) throw new Error(problems.join("\n"));
    const duration = (rows.length / wide - 1) * T_pos, tasks = tasks_of(data.evaluate, segments, duration);
    const found = await this.unit.run({ parameters, feeds: machine.feeds, rows, ratio: Math.round(T_pos / T_c), every: machine.every, T_c,
      reals: machine.signals.map(name => machine.references[name][0]), flags: machine.axes.flatMap(axis => machine.flags.map(flag => machine.references[`${axis}.${flag}`][0])) }, between);
    if (!found) return null;
    const trace = { time: found.time }, names = [...machine.signals, ...machine.axes.flatMap(axis => machine.flags.map(flag => `${axis}.${flag}`))];
    names.forEach((name, k) => { trace[name] = found.columns[k]; });
    return { trace, rows, segments, tasks, figures: figures_of(trace, tasks), warnings: limit_warnings(machine, trace) };
  }

  bode(state, axis, between) {
    return bode(this.unit, this.data.machine, applied(this.data, state).parameters, axis, between);
  }
}

async function unpacked(text) {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let k = 0; k < raw.length; k++) bytes[k] = raw.charCodeAt(k);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

async function work_of(data) {
  const files = {};
  for (const name in data.files) files[name] = await unpacked(data.files[name]);
  const given = data.given && { segments: data.given.segments, rows: new Float64Array((await unpacked(data.given.rows)).buffer) };
  return new Work(data, await unpacked(data.module), files, given);
}
