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
  let reported = performance.now();
  const on = async share => {
    if (performance.now() - reported > PROGRESS) { postMessage({ id, share }); reported = performance.now(); }
    return latest();
  };
  newest = id;
  if (!(await latest())) return;
  try {
    const result = await work.run(state, on);
    if (!result) return;
    postMessage({ id, result });
  } catch (error) { postMessage({ id, problem: String(error.message || error) }); }
  if (!axis || !(await latest())) return;
  try {
    const loop = await work.bode(state, axis, on);
    if (loop) postMessage({ id, loop });
  } catch (error) { postMessage({ id, loop: { axis, problem: String(error.message || error), frequency: [] } }); }
};
