// In the worker: one state at a time; a newer one ends what is under way.
let work = null, newest = 0;
const PROGRESS = 150; // ms; what is done sooner needs no bar
const turns = new MessageChannel(), waiting = [];
turns.port1.onmessage = () => waiting.shift()();
const breath = () => new Promise(done => { waiting.push(done); turns.port2.postMessage(0); });

onmessage = async ({ data: asked }) => {
  if (asked.data) {
    try { work = await work_of(asked.data); postMessage({ ready: true }); } catch (error) { postMessage({ failed: String(error.message || error) }); }
    return;
  }
  const { id, state, axis } = asked, latest = async () => { await breath(); return id === newest; };
  let told = performance.now();
  const on = async share => {
    if (performance.now() - told > PROGRESS) { postMessage({ id, share }); told = performance.now(); }
    return latest();
  };
  newest = id;
  if (!(await latest())) return;
  try {
    const found = await work.run(state, on);
    if (!found) return;
    postMessage({ id, found });
    if (!(await latest())) return;
    postMessage({ id, causes: work.causes(state, found) });
    const warnings = await work.warnings(state, found, latest);
    if (!warnings) return;
    postMessage({ id, warnings });
  } catch (error) { postMessage({ id, problem: String(error.message || error) }); }
  if (!axis || !(await latest())) return;
  try {
    const loop = await work.bode(state, axis, on);
    if (loop) postMessage({ id, loop });
  } catch (error) { postMessage({ id, loop: { axis, problem: String(error.message || error), frequency: [] } }); }
};
