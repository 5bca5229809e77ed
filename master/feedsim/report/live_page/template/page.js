// The page: knobs, states, what the worker answers, figures, exports. Charts are made by pictures.js and drawn as in reports.
const HELD = JSON.parse(document.getElementById("feedsim-page").textContent), KNOBS = HELD.knobs;
const by = id => document.getElementById(id), START = KNOBS.map(knob => knob.value);
const view = { state: [...START], undo: [], redo: [], result: null, loop: null, kept: null, kept_loop: null, lesson: null, step: 0 };
const STEPS = 400; // of a slider

// --- values -------------------------------------------------------------------------------------------------------------

const limited = (knob, value) => Math.min(Math.max(value, knob.least ?? -Infinity), knob.most ?? Infinity);
const shown_value = (knob, value) => knob.choices.length ? value : number(value * knob.factor, 6).replaceAll("−", "-").replace(/×10.*/, "") && String(Number((value * knob.factor).toPrecision(5)));
const unit_text = knob => knob.shown === "1" ? "" : knob.shown.replace("N.m", "N·m").replaceAll(".s", "·s").replace(/^u(?=[a-z])/, "µ");
const logarithmic = knob => knob.low > 0 && knob.high / knob.low > 4;

function place_of(knob, value) {
  const share = logarithmic(knob) ? Math.log(value / knob.low) / Math.log(knob.high / knob.low) : (value - knob.low) / (knob.high - knob.low || 1);
  return Math.round(STEPS * Math.min(Math.max(share || 0, 0), 1));
}

function value_at(knob, place) {
  const share = place / STEPS, value = logarithmic(knob) ? knob.low * (knob.high / knob.low) ** share : knob.low + share * (knob.high - knob.low);
  return limited(knob, Number((value * knob.factor).toPrecision(4)) / knob.factor);
}

// --- the worker: the newest state wins ----------------------------------------------------------------------------------

let worker = null, asked = 0, busy = false, again = false, ready = false, chosen_axis = HELD.axes[HELD.axes.length - 1];

function ask() {
  if (!ready || busy) { again = true; return; }
  again = false;
  busy = true;
  document.documentElement.dataset.asked = String(++asked);
  worker.postMessage({ id: asked, state: view.state, axis: chosen_axis });
}

function answered({ data }) {
  if (data.failed) return tell(`This machine cannot be computed here: ${data.failed}`, true);
  if (data.ready) { ready = true; by("page").classList.add("alive"); return ask(); }
  if (data.id !== asked) return;
  if (data.share !== undefined) { by("progress").value = data.share; return; }
  by("progress").value = 1;
  if (data.loop) {
    view.loop = data.loop;
    show_loop();
    document.documentElement.dataset.loops = String(asked);
    return;
  }
  busy = false;
  if (data.problem) {
    to_draw = [];
    tell(`With these values there is no run: ${data.problem}`, true);
    document.documentElement.dataset.shown = String(asked);
  } else {
    view.result = data.result;
    for (const section of document.querySelectorAll("section[id^=why-]")) section.hidden = changed().length > 0;
    show();
  }
  if (again) ask();
}

// Its script is packed, so that a mail takes the page.
async function begin_worker() {
  const script = new Blob([await unpacked(by("feedsim-worker").textContent)], { type: "text/javascript" });
  worker = new Worker(URL.createObjectURL(script));
  worker.onmessage = answered;
  worker.onerror = event => tell(`The worker has stopped: ${event.message}`, true);
  worker.postMessage({ data: HELD });
}

// --- what is seen -------------------------------------------------------------------------------------------------------

function tell(text, wrong = false) {
  by("problem").textContent = text;
  by("problem").hidden = !text;
  by("problem").classList.toggle("warning", wrong);
  by("pictures").classList.toggle("stale", wrong);
}

function draw_chart(stem, chart) {
  const figure = by(stem), live = lives.find(entry => entry.stem === stem), before = DATA.charts[stem];
  DATA.charts[stem] = chart;
  if (!live) begin(figure);
  else {
    const names = entry => JSON.stringify([entry.panels.length, entry.panels.map(panel => (panel.curves || []).map(curve => curve.name))]);
    live.chart = chart;
    live.told_apart();
    if (names(before) !== names(chart)) { live.hidden.clear(); live.bar.replaceChildren(); live.buttons(); live.zooms = chart.panels.map(() => ({ x: null, y: null })); }
    chart.panels.forEach((panel, k) => { if (panel.kind === "polar") live.reaches[k] = panel.ring * panel.rings / 2 ** Number(live.slider ? live.slider.value : 0); });
    live.draw();
  }
  if (before) forget(before);
}

const slug = text => text.replace(/[^A-Za-z0-9]+/g, "-");

// Pictures of the newest state that are still to be drawn; what is in sight comes first. A slow machine shows a frame in between.
const AT_A_TIME = 40; // ms
let to_draw = [], drawing = 0;
const turns = new MessageChannel();
turns.port1.onmessage = () => draw_on();

function draw_on() {
  const begun = performance.now();
  while (to_draw.length) {
    const [stem, chart] = to_draw.shift();
    draw_chart(stem, chart());
    if (to_draw.length && performance.now() - begun > AT_A_TIME) { turns.port2.postMessage(0); return; }
  }
  document.documentElement.dataset.shown = String(drawing); // of the answers, for those who wait
}

// A kept state, where it has the circles and stops of the present one.
const comparable = () => view.kept && view.kept.tasks.map(entry => entry.prefix).join() === view.result.tasks.map(entry => entry.prefix).join() ? view.kept : null;
const contour_now = task => contour_chart(task, view.result, comparable());

function show() {
  tell("");
  const { result, kept } = view, charts = [], same = comparable();
  for (const task of result.tasks) {
    const end = slug(task.prefix);
    if (task.kind === "circle") charts.push([`contour-${end}`, () => contour_now(task)], [`torque-${end}`, () => torque_chart(task, result, same, HELD.signs)]);
    else charts.push([`stop-${end}`, () => stop_chart(task, result, same, HELD.signs)]);
  }
  charts.push(["following", () => following_chart(HELD.moved, result, kept)]);
  const seen = charts.map(([stem]) => { const { top, bottom } = by(stem).getBoundingClientRect(); return bottom > 0 && top < innerHeight; });
  to_draw = [...charts.filter((_, k) => seen[k]), ...charts.filter((_, k) => !seen[k])];
  drawing = asked;
  draw_on();
  show_figures();
  show_warnings();
  lesson_look();
}

function show_loop() {
  const { loop } = view, { axis } = loop;
  show_warnings();
  if (!loop.frequency.length) by("margins").textContent = loop.problem || `The loops of axis ${axis} are unstable with any K_v tried: there is no frequency response to show.`;
  else {
    draw_chart("bode", bode_chart(loop, view.kept_loop && view.kept_loop.axis === axis ? view.kept_loop : null));
    const gain = Number.isFinite(loop.gain_margin) ? `${fixed(20 * Math.log10(loop.gain_margin), 1)} dB at ${number(loop.gain_at, 3)} Hz` : "none is reached";
    by("margins").textContent = `Axis ${axis}, sliding (friction left out): gain margin ${gain}; phase margin ${fixed(loop.phase_margin, 0)}° at ${number(loop.phase_at, 3)} Hz. Usual are 6 dB and 30°.`;
  }
  lesson_look();
}

function show_warnings() {
  const { result, loop } = view, grows = loop && loop.growing ? [`axis ${loop.axis}: its loops are unstable with these values: what an impulse leaves grows`] : [];
  const list = [...grows, ...(result ? result.warnings : [])].map(typeset);
  by("warnings").replaceChildren(...list.map(text => { const item = document.createElement("li"); item.textContent = text; return item; }));
  by("warned").hidden = !list.length;
}

const three_digits = (value, unit) => Number.isFinite(value) ? `${three(value)} ${unit.replace("um", "µm").replace("N.m", "N·m")}` : "not determined";
const four = (value, unit) => Number.isFinite(value) ? `${number(value, 4)} ${unit.replace("um", "µm").replace("N.m", "N·m")}` : "not determined";

// Rows stay as long as their names and columns do: only what has changed is written.
function show_figures() {
  for (const tile of document.querySelectorAll("#keys .key")) {
    const name = tile.dataset.figure, figure = view.result.figures[name], written = HELD.written[name];
    tile.querySelector("b").textContent = figure ? three_digits(...figure) : "–";
    tile.querySelector("small").textContent = `as written ${three_digits(...written)}`;
    tile.classList.toggle("changed", Boolean(figure) && three_digits(...figure) !== three_digits(...written));
  }
  const { result, kept } = view, heads = ["figure", "now", ...(kept ? ["kept"] : []), "as written"], names = Object.keys(result.figures), table = by("figures"), body = table.tBodies[0];
  const text = figures => name => figures[name] ? four(...figures[name]) : "–", columns = [name => result.figures[name] ? four(...result.figures[name]) : null, ...(kept ? [text(kept.figures)] : []), text(HELD.written)];
  const layout = [...heads, ...names].join("\n");
  if (table.dataset.layout !== layout) {
    table.dataset.layout = layout;
    const head = document.createElement("tr");
    heads.forEach((title, k) => element("th", { scope: "col", ...(k ? { class: "number" } : {}) }, head, title));
    table.tHead.replaceChildren(head);
    body.replaceChildren(...names.map(name => {
      const row = document.createElement("tr");
      row.classList.toggle("more", /\.(tool|clockwise)\.|\.glitch_.*[-+]$/.test(name));
      element("th", { scope: "row" }, row, name);
      for (const column of columns) element("td", { class: "number" }, row, column(name) ?? "…");
      return row;
    }));
    return;
  }
  names.forEach((name, k) => columns.forEach((column, j) => {
    const cell = body.rows[k].cells[j + 1], value = column(name);
    cell.classList.toggle("stale", value === null);
    if (value !== null && cell.textContent !== value) cell.textContent = value;
  }));
}

// --- knobs --------------------------------------------------------------------------------------------------------------

const inputs = KNOBS.map((knob, k) => {
  const row = by(`knob-${k}`), slider = row.querySelector("input[type=range]"), field = row.querySelector("input[type=number]"), choice = row.querySelector("select");
  const back = row.querySelector("button");
  let before = null;
  const turn = (value, done) => {
    if (!knob.choices.length && !Number.isFinite(value)) return;
    if (before === null) before = [...view.state];
    view.state[k] = knob.choices.length ? value : limited(knob, value);
    if (done) { if (before.some((entry, i) => entry !== view.state[i])) { view.undo.push(before); view.redo.length = 0; } before = null; settle(); }
    sync();
    ask();
  };
  if (choice) choice.addEventListener("change", () => turn(choice.value, true));
  else {
    slider.addEventListener("input", () => turn(value_at(knob, Number(slider.value)), false));
    slider.addEventListener("change", () => turn(view.state[k], true));
    field.addEventListener("change", () => turn(field.value === "" ? NaN : Number(field.value) / knob.factor, true));
  }
  back.addEventListener("click", () => turn(START[k], true));
  return { row, slider, field, choice, back };
});

function sync() {
  KNOBS.forEach((knob, k) => {
    const { row, slider, field, choice, back } = inputs[k], value = view.state[k];
    if (choice) choice.value = value;
    else {
      slider.value = place_of(knob, value);
      slider.setAttribute("aria-valuetext", `${shown_value(knob, value)} ${unit_text(knob)}`);
      if (field !== document.activeElement || Number(field.value) !== Number(shown_value(knob, value))) field.value = shown_value(knob, value);
    }
    row.classList.toggle("changed", value !== START[k]);
    back.disabled = value === START[k];
  });
  by("undo").disabled = !view.undo.length;
  by("redo").disabled = !view.redo.length;
}

function go_to(state, remember = true) {
  if (remember && state.some((entry, k) => entry !== view.state[k])) { view.undo.push([...view.state]); view.redo.length = 0; }
  view.state = [...state];
  settle();
  sync();
  ask();
}

function settle() {
  const text = changed().map(([key, value]) => `${encodeURIComponent(key)}=${encodeURIComponent(value)}`).join("&");
  try { history.replaceState(null, "", text ? `#${text}` : "#"); } catch { /* a page inside a mail viewer has no address */ }
}

const changed = () => KNOBS.flatMap((knob, k) => view.state[k] === START[k] ? [] : [[knob.key, view.state[k], knob]]);

function from_address() {
  const state = [...START];
  for (const part of location.hash.slice(1).split("&")) {
    const [key, value] = part.split("=").map(entry => { try { return decodeURIComponent(entry || ""); } catch { return ""; } }), k = KNOBS.findIndex(knob => knob.key === key);
    if (k < 0) continue;
    if (KNOBS[k].choices.length ? KNOBS[k].choices.includes(value) : value !== "" && Number.isFinite(Number(value))) state[k] = KNOBS[k].choices.length ? value : limited(KNOBS[k], Number(value));
  }
  return state;
}

// --- what can be taken away ---------------------------------------------------------------------------------------------

const quantity = (knob, value) => knob.choices.length ? value : `${value}${knob.unit === "1" ? "" : ` ${knob.unit}`}`;
const set_line = () => changed().map(([key, value, knob]) => `--set "${key}=${quantity(knob, value)}"`).join(" ") || "(nothing is changed)";
const yaml_text = () => `set:\n${changed().map(([key, value, knob]) => `  ${key}: ${quantity(knob, value)}\n`).join("")}`;

function csv_text() {
  const { trace } = view.result, names = Object.keys(trace), rows = [names.join(",")];
  for (let k = 0; k < trace.time.length; k++) rows.push(names.map(name => String(trace[name][k])).join(","));
  return `${rows.join("\n")}\n`;
}

function save(name, text) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

async function copy(text, what) {
  by("taken").value = text;
  by("taken").hidden = false;
  by("taken").select();
  try { await navigator.clipboard.writeText(text); by("said").textContent = `${what} copied`; } catch { by("said").textContent = `${what}: below, to be copied`; }
}

const on = (id, act) => by(id).addEventListener("click", act);
on("undo", () => { if (view.undo.length) { view.redo.push([...view.state]); go_to(view.undo.pop(), false); } });
on("redo", () => { if (view.redo.length) { view.undo.push([...view.state]); go_to(view.redo.pop(), false); } });
on("more", () => {
  const all = by("figures").classList.toggle("all");
  by("more").setAttribute("aria-expanded", String(all));
  by("more").textContent = all ? "Show fewer" : "Show all";
});
on("reset", () => go_to(START));
on("keep", () => {
  const clear = view.kept !== null;
  view.kept = clear ? null : view.result;
  view.kept_loop = clear ? null : view.loop;
  by("keep").setAttribute("aria-pressed", String(!clear));
  by("keep").textContent = clear ? "Keep this state" : "Drop the kept state";
  if (view.result) show();
  if (view.loop) show_loop();
});
on("link", () => { settle(); copy(location.href, "link"); });
on("set", () => copy(set_line(), "settings for feedsim run"));
on("yaml", () => copy(yaml_text(), "YAML of the changes"));
on("csv", () => { if (view.result) save("result.csv", csv_text()); });
by("axis").addEventListener("change", () => { chosen_axis = by("axis").value; ask(); });
addEventListener("keydown", event => {
  if (!(event.ctrlKey || event.metaKey) || event.key.toLowerCase() !== "z" || event.target.matches("input[type=number], textarea")) return;
  event.preventDefault();
  by(event.shiftKey ? "redo" : "undo").click();
});
addEventListener("hashchange", () => go_to(from_address()));

// --- lessons ------------------------------------------------------------------------------------------------------------

const offered = LESSONS.filter(lesson => lesson.fits(HELD));

// seen: the lesson was asked for here; one that the address names takes no focus.
function lesson_begin(lesson, seen = true) {
  const values = lesson.start(HELD, key => START[KNOBS.findIndex(knob => knob.key === key)]);
  view.lesson = { ...lesson, done: false };
  view.kept = view.kept_loop = null;
  go_to(KNOBS.map((knob, k) => values[knob.key] ?? START[k]));
  by("lesson").hidden = false;
  by("lesson-title").textContent = lesson.title;
  by("lesson-text").replaceChildren(...lesson.text(HELD).map(text => { const item = document.createElement("p"); item.textContent = text; return item; }));
  by("lesson-state").textContent = "";
  for (const { row } of inputs) row.classList.remove("pointed");
  for (const key of lesson.turn(HELD)) { const k = KNOBS.findIndex(knob => knob.key === key); if (k >= 0) inputs[k].row.classList.add("pointed"); }
  by("lesson-more").open = innerWidth >= 992 && innerHeight >= 640; // else its knobs would lie below the first screen
  by("page").classList.add("in-lesson");
  if (seen) by("lesson").focus();
}

function lesson_look() {
  const { lesson } = view;
  if (!lesson || !view.result) return;
  const { text, done } = lesson.look(HELD, view);
  by("lesson-state").textContent = done ? `✓ ${text} ${lesson.after}` : text;
  by("lesson").classList.toggle("done", done);
}

on("lesson-end", () => { view.lesson = null; by("lesson").hidden = true; by("page").classList.remove("in-lesson"); for (const { row } of inputs) row.classList.remove("pointed"); go_to(START); });
for (const lesson of offered) element("button", { type: "button" }, by("lessons"), lesson.title).addEventListener("click", () => lesson_begin(lesson));
by("lessons-part").hidden = !offered.length;
const first = offered[Number(new URLSearchParams(location.hash.slice(1)).get("lesson")) - 1];

view.state = from_address();
sync();
if (first) lesson_begin(first, false);
begin_worker().catch(error => tell(`This browser cannot compute the machine: ${error.message}`, true));
