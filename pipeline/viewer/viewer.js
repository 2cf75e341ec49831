"use strict";
// The sheet of a run under a light of the reader's: state, input, and one WebGL2 program a method. Nothing is drawn
// unless something has changed. Matrices are arrays of rows; lengths in mm, x right, y up, z towards the reader.

const STEEPEST = 0.985;        // sine of the light's largest angle from the normal
const MOST_TURN = 1.3;         // radians
const LARGEST_DOT = 160;       // pixels of a dot at the closest zoom
const LINES_FROM = 22;         // pixels of a dot from which its orientation is drawn
const MOST_SAMPLES = 4;
const SLOW_MS = 50;            // where frames take longer, fewer pixels are drawn while something moves
const LEAST_PART = 0.125;      // of the pixels along a side
const LONGEST_MS = 3000;       // that a frame may take to be drawn finer once nothing moves
const MARGIN = 1.05;

const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
const transposed = m => m[0].map((_, i) => m.map(row => row[i]));
const times = (a, b) => a.map(row => transposed(b).map(column => dot(row, column)));
const applied = (m, v) => m.map(row => dot(row, v));
const scaled = (v, s) => v.map(x => x * s);
const unit = v => scaled(v, 1 / Math.hypot(...v));
const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
const limited = (x, low, high) => Math.min(Math.max(x, low), high);

async function inflated(text) {
  const packed = Uint8Array.from(atob(text), c => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Two planes of differences between neighbours, high bytes before low ones, to pairs of codes.
function codes(bytes) {
  const count = bytes.length / 4, found = new Uint16Array(2 * count);
  for (let plane = 0; plane < 2; plane++) {
    const high = bytes.subarray(2 * plane * count), low = bytes.subarray((2 * plane + 1) * count);
    for (let i = 0, code = 0; i < count; i++) {
      code = (code + 256 * high[i] + low[i]) & 0xffff;
      found[2 * i + plane] = code;
    }
  }
  return found;
}

// Right, up and back of a camera that looks at the middle of the sheet.
function cameraAxes(eye) {
  const back = unit(eye);
  const right = unit(cross(Math.hypot(back[0], back[2]) > 1e-6 ? [0, 1, 0] : [0, 0, -1], back));
  return [right, cross(back, right), back];
}

function rotation(yaw, pitch) {
  const [c, s, d, t] = [Math.cos(yaw), Math.sin(yaw), Math.cos(pitch), Math.sin(pitch)];
  return times([[1, 0, 0], [0, d, -t], [0, t, d]], [[c, 0, s], [0, 1, 0], [-s, 0, c]]);
}

class Painter {
  // What draws: textures and programs on one canvas.
  constructor(canvas, sheet, bytes) {
    const gl = canvas.getContext("webgl2", {antialias: false, depth: false, powerPreference: "high-performance"});
    if (!gl) throw new Error("no WebGL2");
    Object.assign(this, {gl, sheet, programs: {}, textures: {}});
    gl.bindVertexArray(gl.createVertexArray());
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const {maps, shares, spectrum} = sheet.textures;
    this.upload("maps", maps.size, gl.RG16UI, gl.RG_INTEGER, gl.UNSIGNED_SHORT, codes(bytes.maps));
    this.upload("shares", shares.size, gl.R32F, gl.RED, gl.FLOAT, new Float32Array(bytes.shares.buffer));
    this.upload("spectrum", spectrum.size, gl.RGBA32F, gl.RGBA, gl.FLOAT, new Float32Array(bytes.spectrum.buffer));
    this.methods = gl.getExtension("EXT_color_buffer_float") ? ["table", "spectral"] : ["spectral"];
    if (this.methods.includes("table")) this.drawTable();
  }

  upload(name, size, internal, format, type, data) {
    const {gl} = this, smooth = data ? gl.NEAREST : gl.LINEAR;
    gl.bindTexture(gl.TEXTURE_2D, this.textures[name] = gl.createTexture());
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, ...size, 0, format, type, data);
    for (const [key, value] of [[gl.TEXTURE_MIN_FILTER, smooth], [gl.TEXTURE_MAG_FILTER, smooth],
      [gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE], [gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE]])
      gl.texParameteri(gl.TEXTURE_2D, key, value);
  }

  forget() {
    Object.values(this.textures).forEach(texture => this.gl.deleteTexture(texture));
    Object.values(this.programs).forEach(({program}) => this.gl.deleteProgram(program));
  }

  drawTable() {
    const {gl, sheet} = this, names = ["shorter", "middle", "longer"];
    for (const name of names) this.upload(name, sheet.colours, gl.RGBA16F, gl.RGBA, gl.HALF_FLOAT, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    const attachments = names.map((name, i) => {
      gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + i, gl.TEXTURE_2D, this.textures[name], 0);
      return gl.COLOR_ATTACHMENT0 + i;
    });
    gl.drawBuffers(attachments);
    this.draw("colours", sheet.colours, {});
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
  }

  program(name) {
    if (this.programs[name]) return this.programs[name];
    const {gl, sheet} = this, program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, sheet.shaders.vertex], [gl.FRAGMENT_SHADER, sheet.shaders[name]]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    const uniforms = {};
    for (let i = 0; i < gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS); i++) {
      const {name: uniform, type} = gl.getActiveUniform(program, i);
      uniforms[uniform] = {at: gl.getUniformLocation(program, uniform), type};
    }
    gl.useProgram(program);
    Object.keys(this.textures).forEach((texture, unit) => {
      if (uniforms[texture]) gl.uniform1i(uniforms[texture].at, unit);
    });
    this.programs[name] = {program, uniforms};
    this.set(uniforms, sheet.constants);
    return this.programs[name];
  }

  set(uniforms, values) {
    const {gl} = this;
    for (const [name, value] of Object.entries(values)) {
      if (!uniforms[name]) continue;
      const {at, type} = uniforms[name];
      if (type === gl.INT || type === gl.BOOL) gl.uniform1i(at, value);
      else if (type === gl.FLOAT_MAT3) gl.uniformMatrix3fv(at, true, value.flat());
      else gl[`uniform${[value].flat().length}fv`](at, [value].flat());
    }
  }

  draw(name, size, values) {
    const {gl} = this, {program, uniforms} = this.program(name);
    gl.viewport(0, 0, ...size);
    gl.useProgram(program);
    this.set(uniforms, values);
    Object.entries(this.textures).forEach(([texture, handle], unit) => {
      if (!uniforms[texture]) return;
      gl.activeTexture(gl.TEXTURE0 + unit);
      gl.bindTexture(gl.TEXTURE_2D, handle);
    });
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }
}

class Viewer {
  constructor(root, sheet, bytes) {
    Object.assign(this, {root, sheet, bytes});
    this.canvas = root.querySelector("canvas");
    this.painter = new Painter(this.canvas, sheet, bytes);
    this.frame = {asked: 0, last: 0, ms: 0, part: 1, finer: 0, drawing: null, stale: false};
    this.pointers = new Map();
    this.sliding = false;
    for (const input of root.querySelectorAll("input[value=table]")) input.disabled = !this.painter.methods.includes("table");
    this.listen();
    this.reset();
    new ResizeObserver(() => this.change()).observe(this.canvas);
  }

  // Other maps of the run, under the light that is there.
  showSheet(sheet, bytes) {
    this.painter.forget();
    Object.assign(this, {sheet, bytes, painter: new Painter(this.canvas, sheet, bytes)});
    this.magnify(1);
  }

  reset() {
    const {start} = this.sheet;
    Object.assign(this, {light: [...start.light], yaw: 0, pitch: 0, zoom: 1, centre: [0, 0], sliding: false});
    for (const input of this.root.querySelectorAll("input[type=range]")) input.value = input.defaultValue;
    this.root.querySelector(`input[value=${this.painter.methods[0]}]`).checked = true;
    this.change();
  }

  // Pixels of the focal length with which the whole sheet is seen, not turned.
  focal() {
    const {size_mm: [width, height], eye} = this.sheet.start, axes = cameraAxes(eye);
    const corners = [[-1, -1], [1, -1], [-1, 1], [1, 1]].map(([x, y]) =>
      applied(axes, [x * width / 2 - eye[0], y * height / 2 - eye[1], -eye[2]]));
    const across = Math.max(...corners.map(([x, , z]) => Math.abs(x / z)));
    const up = Math.max(...corners.map(([, y, z]) => Math.abs(y / z)));
    return Math.min(this.canvas.width / across, this.canvas.height / up) / 2 / MARGIN;
  }

  // The picture as Python's View has it, and the light; all in the frame of the sheet, which turns.
  view() {
    const {width, height} = this.canvas, {start} = this.sheet, focal = this.focal();
    const camera = cameraAxes(start.eye);
    const turn = times(transposed(camera), times(rotation(this.yaw, this.pitch), camera));
    const [eye, light] = [start.eye, this.light].map(place => applied(transposed(turn), place));
    const k = this.zoom, [cx, cy] = scaled(this.centre, width);
    const rays = [[1, 0, 0.5 - width / 2], [0, -1, height / 2 - 0.5], [0, 0, -focal]].map(row => scaled(row, 1 / focal));
    const magnified = [[1 / k, 0, (width - 1) / 2 * (1 - 1 / k) + cx], [0, 1 / k, (height - 1) / 2 * (1 - 1 / k) + cy], [0, 0, 1]];
    const [x, y, z] = times(times(transposed(times(camera, turn)), rays), magnified);
    const to_sheet = [0, 1].map(i => [x, y][i].map((value, j) => eye[2] * value - eye[i] * z[j]));
    return {to_sheet: [...to_sheet, scaled(z, -1)], eye, light, rows: height, columns: width};
  }

  texelPixels() {
    return this.focal() * this.zoom * this.sheet.constants.pixel_mm / Math.hypot(...this.sheet.start.eye);
  }

  // How many of the pixels along a side the last frame drew.
  drawnPart() { return this.canvas.width / (this.canvas.clientWidth * Math.min(devicePixelRatio || 1, 2)); }

  setting(name) {
    const value = Number(this.root.querySelector(`input[name=${name}]`).value);
    return {light_sigma: value * value, depth: value, period_scale: 2 ** value, exposure: 2 ** value}[name];
  }

  method() { return this.root.querySelector("input[name=method]:checked").value; }

  // One frame at a time: a slow card is not sent a queue of them.
  change() {
    const {frame} = this;
    frame.finer = 0;
    if (frame.drawing) frame.stale = true;
    else this.ask();
  }

  ask() {
    if (!this.frame.asked) this.frame.asked = requestAnimationFrame(now => this.tick(now));
  }

  tick(now) {
    const {frame, painter: {gl}} = this, moving = this.sliding || this.pointers.size > 0;
    const part = frame.finer || frame.part;
    Object.assign(frame, {asked: 0, last: now, stale: false});
    this.paint(part);
    frame.drawing = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.tell();
    this.finish(moving, part);
  }

  // Wait until the card has drawn, and choose how many pixels it draws next: more and more once nothing moves.
  finish(moving, part) {
    const {frame, painter: {gl}} = this;
    if (!frame.drawing) return;
    if (!gl.isContextLost() && gl.getSyncParameter(frame.drawing, gl.SYNC_STATUS) !== gl.SIGNALED) {
      setTimeout(() => this.finish(moving, part), 2);
      return;
    }
    const ms = performance.now() - frame.last;
    gl.deleteSync(frame.drawing);
    frame.drawing = null;
    if (moving) frame.ms = frame.ms ? 0.8 * frame.ms + 0.2 * ms : ms;
    if (ms > SLOW_MS) frame.part = limited(part / 2, LEAST_PART, frame.part);
    else if (moving && ms < SLOW_MS / 8) frame.part = Math.min(2 * part, 1);
    const finer = Math.min(2 * part, 1);
    const expected = ms * (finer * this.mostSamples(finer) / (part * this.mostSamples(part))) ** 2;
    if (frame.stale) this.change();
    else if (!moving && part < 1 && expected < LONGEST_MS) {
      frame.finer = finer;
      this.ask();
    }
  }

  mostSamples(part) { return part < 1 ? 2 : MOST_SAMPLES; }

  // All pixels, or a part of them along each side.
  paint(part = 1) {
    const {canvas} = this, ratio = Math.min(devicePixelRatio || 1, 2) * part;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight].map(side => Math.max(1, Math.round(side * ratio)));
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, {width, height});
    const samples = limited(Math.ceil(1 / this.texelPixels() - 0.01), 1, this.mostSamples(part));
    this.painter.draw(this.method(), [width, height], {
      ...this.view(), samples, pixel_part: 1 / samples, encoded: true, lines_from: LINES_FROM * ratio,
      exposure: this.setting("exposure") * this.sheet.start.exposure, light_sigma: this.setting("light_sigma"),
      depth: this.setting("depth"), period_scale: this.setting("period_scale"),
    });
  }

  tell() {
    const [x, y, z] = this.light, away = Math.hypot(x, y, z), degrees = 180 / Math.PI;
    const azimuth = Math.round(Math.atan2(y, x) * degrees), elevation = Math.round(Math.asin(z / away) * degrees);
    const lamp = this.root.querySelector(".lamp");
    lamp.setAttribute("cx", 22 + 19 * x / away);
    lamp.setAttribute("cy", 22 - 19 * y / away);
    const {ms} = this.frame, rate = ms ? `${Math.min(1000 / ms, 60).toFixed(ms > 100 ? 1 : 0)} frames/s` : "";
    const words = {
      place: `light ${azimuth}°, ${elevation}° up`.replaceAll("-", "−"), rate,
      light_sigma: `${this.setting("light_sigma").toFixed(1)} mm`, depth: `${this.setting("depth").toFixed(2)} µm`,
      period_scale: `× ${this.setting("period_scale").toFixed(2)}`, exposure: `× ${this.setting("exposure").toPrecision(2)}`,
    };
    for (const [name, text] of Object.entries(words)) this.root.querySelector(`output[data-of=${name}]`).value = text;
  }

  moveLight(dx, dy) {
    const away = Math.hypot(...this.light);
    let [x, y] = [this.light[0] + dx * away, this.light[1] - dy * away];
    const aside = Math.hypot(x, y), most = STEEPEST * away;
    if (aside > most) [x, y] = scaled([x, y], most / aside);
    this.light = [x, y, Math.sqrt(away * away - x * x - y * y)];
    this.change();
  }

  turn(dx, dy) {
    this.yaw = limited(this.yaw + dx, -MOST_TURN, MOST_TURN);
    this.pitch = limited(this.pitch + dy, -MOST_TURN, MOST_TURN);
    this.change();
  }

  pan(dx, dy) {
    const high = this.canvas.clientHeight / this.canvas.clientWidth;
    this.centre = [[dx, 1], [dy, high]].map(([d, side], i) => limited(this.centre[i] - d / this.zoom, -side / 2, side / 2));
    this.change();
  }

  // Zoom about a point, in widths of the picture from its middle.
  magnify(factor, x = 0, y = 0) {
    const closest = LARGEST_DOT * this.drawnPart() / (this.texelPixels() / this.zoom), before = this.zoom;
    this.zoom = limited(this.zoom * factor, 1, Math.max(closest, 1));
    const moved = 1 - this.zoom / before;
    this.pan(moved * x, moved * y);
    if (this.zoom === 1) this.centre = [0, 0];
  }

  // In widths of the picture from its middle.
  at(event) {
    const box = this.canvas.getBoundingClientRect();
    return [event.clientX - box.left - box.width / 2, event.clientY - box.top - box.height / 2].map(x => x / box.width);
  }

  drag(event) {
    const before = this.pointers.get(event.pointerId);
    if (!before) return;
    const now = this.at(event), [dx, dy] = [now[0] - before[0], now[1] - before[1]];
    const others = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
    this.pointers.set(event.pointerId, now);
    if (others.length) {
      const [o] = others, middle = [0, 1].map(i => (now[i] + o[i]) / 2);
      const distances = [before, now].map(place => Math.hypot(place[0] - o[0], place[1] - o[1]));
      if (this.zoom > 1) this.pan(dx / 2, dy / 2);
      else this.turn(1.5 * dx, 1.5 * dy);
      this.magnify(distances[1] / Math.max(distances[0], 1e-3), ...middle);
    } else if (event.shiftKey || event.buttons & 2) this.turn(3 * dx, 3 * dy);
    else if (event.altKey || event.buttons & 4) this.pan(dx, dy);
    else this.moveLight(1.6 * dx, 1.6 * dy);
  }

  key(event) {
    const step = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[event.key];
    if (event.ctrlKey || event.metaKey) return;
    if (step && event.shiftKey) this.turn(...scaled(step, 0.05));
    else if (step && event.altKey) this.pan(...scaled(step, -0.05));
    else if (step) this.moveLight(...scaled(step, 0.03));
    else if ("+=".includes(event.key)) this.magnify(1.25);
    else if (event.key === "-") this.magnify(0.8);
    else if (event.key === "r") this.reset();
    else if (event.key === "m") this.switchMethod();
    else if (event.key === "s") this.save();
    else return;
    event.preventDefault();
  }

  switchMethod() {
    const choices = [...this.root.querySelectorAll("input[name=method]:enabled")];
    choices[(choices.findIndex(choice => choice.checked) + 1) % choices.length].checked = true;
    this.change();
  }

  save() {
    this.paint();
    this.canvas.toBlob(blob => {
      const link = Object.assign(document.createElement("a"), {download: this.sheet.file, href: URL.createObjectURL(blob)});
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }

  listen() {
    const {canvas, root} = this;
    const release = event => { this.pointers.delete(event.pointerId); this.change(); };
    const listeners = {
      pointerdown: event => {
        canvas.setPointerCapture(event.pointerId);
        canvas.focus({preventScroll: true});
        this.pointers.set(event.pointerId, this.at(event));
        if (event.button === 1) event.preventDefault();
      },
      pointermove: event => this.drag(event),
      pointerup: release, pointercancel: release,
      contextmenu: event => event.preventDefault(),
      dblclick: () => this.reset(),
      keydown: event => this.key(event),
      wheel: event => {
        if (document.activeElement !== canvas && !event.ctrlKey) return;  // the page scrolls until the sheet is taken
        event.preventDefault();
        this.magnify(Math.exp(-limited(event.deltaY * (event.deltaMode ? 30 : 1), -200, 200) / 300), ...this.at(event));
      },
      webglcontextlost: event => event.preventDefault(),
      webglcontextrestored: () => {
        this.painter = new Painter(canvas, this.sheet, this.bytes);
        this.frame.drawing = null;
        this.change();
      },
    };
    for (const [name, listener] of Object.entries(listeners)) canvas.addEventListener(name, listener, {passive: false});
    const controls = root.querySelector(".controls");
    controls.addEventListener("input", event => { this.sliding = event.target.type === "range"; this.change(); });
    controls.addEventListener("change", () => { this.sliding = false; this.change(); });
    root.querySelector("button[name=save]").addEventListener("click", () => this.save());
    root.querySelector("button[name=reset]").addEventListener("click", () => this.reset());
  }
}

async function unpacked(script) {
  const sheet = JSON.parse(script.textContent), names = Object.keys(sheet.textures);
  const bytes = await Promise.all(names.map(name => inflated(sheet.textures[name].data)));
  return [sheet, Object.fromEntries(names.map((name, i) => [name, bytes[i]]))];
}

async function show(root) {
  const scripts = root.querySelectorAll("script[type='application/json']"), choice = root.querySelector("select[name=maps]");
  try {
    root.viewer = new Viewer(root, ...await unpacked(scripts[0]));
    root.classList.add("live");
  } catch (error) {
    root.querySelector(".sorry").append(` (${error.message})`);
    root.classList.add("still");
    return;
  }
  choice?.addEventListener("change", async () => {
    const chosen = choice.selectedIndex, found = await unpacked(scripts[chosen]);
    if (choice.selectedIndex !== chosen) return;
    root.viewer.showSheet(...found);
    root.querySelector(".whose").textContent = choice.selectedOptions[0].title;
  });
}

document.querySelectorAll("figure.viewer").forEach(show);
