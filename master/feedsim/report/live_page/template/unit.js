// The unit `machine` as the module of this page: instance, parameters, runs. src/page/loop.c has what is called here.
const WARNING = 1; // the FMI's statuses above are failures

class Unit {
  // bytes: of the module; files: name -> bytes of resources; guid: of the archive they are of.
  constructor(bytes, files, guid) {
    this.said = [];
    const refuse = () => 8; // EBADF: there is no file to write to
    this.of = new WebAssembly.Instance(new WebAssembly.Module(bytes), {
      page: { say: (status, at) => this.said.push([status, this.text(at)]) },
      wasi_snapshot_preview1: { fd_close: refuse, fd_seek: refuse, fd_write: refuse },
    }).exports;
    if (this.of._initialize) this.of._initialize();
    for (const name in files) this.call("page_give", this.put(new TextEncoder().encode(`${name}\0`)), this.put(files[name]), files[name].length);
    this.call("page_open", this.put(new TextEncoder().encode(`${guid}\0`)));
    this.rooms = new Map();
  }

  text(at) {
    const bytes = new Uint8Array(this.of.memory.buffer);
    let end = at;
    while (bytes[end]) end++;
    return new TextDecoder().decode(bytes.subarray(at, end));
  }

  // Bytes into memory of the module; where they lie.
  put(bytes) {
    const at = this.of.page_alloc(Math.max(1, bytes.length));
    new Uint8Array(this.of.memory.buffer).set(bytes, at);
    return at;
  }

  // Room for `count` doubles, kept from run to run. Memory that grows detaches views: they are made anew after each call.
  room(name, count) {
    const known = this.rooms.get(name);
    if (known && known.count >= count) return known.at;
    if (known) this.of.page_free(known.at);
    const at = this.of.page_alloc(8 * Math.max(1, count));
    if (!at) throw new Error("out of memory");
    this.rooms.set(name, { at, count });
    return at;
  }

  numbers(name, values) {
    const at = this.room(name, values.length);
    new Float64Array(this.of.memory.buffer, at, values.length).set(values);
    return at;
  }

  references(name, values) {
    const at = this.room(name, Math.ceil(values.length / 2));
    new Uint32Array(this.of.memory.buffer, at, values.length).set(values);
    return at;
  }

  call(name, ...values) {
    this.said.length = 0;
    if (this.of[name](...values) > WARNING) throw new Error(this.said.map(entry => entry[1]).join("; ") || `${name} failed`);
  }

  set([reference, kind, value]) {
    this.call({ r: "page_set_real", i: "page_set_integer", b: "page_set_boolean" }[kind], reference, Number(value));
  }

  // A run from rest. feeds: value references; rows: what is fed, a row every `ratio` cycles of T_c, N rows; reals, flags:
  // what is recorded every `every` cycles. between(share) is awaited now and then: false ends the run.
  async run({ parameters, feeds, rows, ratio, every, T_c, reals, flags }, between) {
    const total = (rows.length / feeds.length - 1) * ratio, width = reals.length + flags.length, count = Math.floor(total / every) + 1;
    this.call("page_reset");
    for (const entry of parameters) this.set(entry);
    const real = this.references("reals", reals), flag = this.references("flags", flags), fed = this.references("feeds", feeds);
    const fedRows = this.numbers("rows", rows), out = this.room("out", width * count);
    this.call("page_begin", total * T_c, feeds.length, fed, fedRows);
    const part = every * Math.max(1, Math.round(PART / every));
    for (let first = 0; first <= total; first += part) {
      const last = Math.min(first + part, total), end = first + part > total ? 1 : 0;
      const at = out + 8 * width * Math.ceil(first / every);
      this.call("page_run", first, last, end, T_c, ratio, feeds.length, fed, fedRows, every, reals.length, real, flags.length, flag, at);
      if (between && !end && !(await between(last / total))) return null;
    }
    const result = new Float64Array(this.of.memory.buffer, out, width * count);
    const columns = Array.from({ length: width }, () => new Float64Array(count));
    for (let k = 0, at = 0; k < count; k++) for (let i = 0; i < width; i++) columns[i][k] = result[at++];
    return { time: Float64Array.from({ length: count }, (_, k) => k * every * T_c), columns };
  }
}
const PART = 16384; // cycles between two looks at what else is asked for: some 20 ms
