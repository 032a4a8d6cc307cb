// The widget of etendue.show(): half floats on a canvas, with exposure, tone mapping and pixel values. No libraries.

function halfToFloat(h) {
  const sign = h & 0x8000 ? -1 : 1, exponent = (h >> 10) & 31, fraction = h & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1 + fraction / 1024) * 2 ** (exponent - 15);
}

// Every half float once, for images of millions of values.
const kFloats = Float32Array.from({ length: 65536 }, (_, h) => halfToFloat(h));

const clamp = (x) => Math.min(Math.max(x, 0), 1);

// The rational function of Narkowicz 2016 at 0.6 x, as in etendue tonemap.
function aces(x) {
  const v = 0.6 * Math.max(x, 0);
  return clamp((v * (2.51 * v + 0.03)) / (v * (2.43 * v + 0.59) + 0.14));
}

const luminance = (r, g, b) => 0.212671 * r + 0.71516 * g + 0.072169 * b;

function srgbCode(x) {
  const v = clamp(x);
  return Math.floor((v <= 0.0031308 ? 12.92 * v : 1.055 * v ** (1 / 2.4) - 0.055) * 255 + 0.5);
}

export function toneMapped(rgb, exposure, operator) {
  const out = new Uint8ClampedArray((rgb.length / 3) * 4), scale = 2 ** exposure;
  let white = 0;
  if (operator === "reinhard")
    for (let i = 0; i < rgb.length; i += 3) {
      const y = luminance(rgb[i], rgb[i + 1], rgb[i + 2]) * scale;
      if (Number.isFinite(y)) white = Math.max(white, y);
    }
  for (let i = 0, o = 0; i < rgb.length; i += 3, o += 4) {
    let c = [rgb[i] * scale, rgb[i + 1] * scale, rgb[i + 2] * scale];
    if (c.some(Number.isNaN)) c = [1, 0, 1];
    else if (operator === "aces") c = c.map(aces);
    else if (operator === "reinhard") {
      const y = luminance(...c);
      const factor = y > 0 ? (1 + y / (white * white)) / (1 + y) : 1;
      c = c.map((x) => x * factor);
    }
    for (let k = 0; k < 3; ++k) out[o + k] = srgbCode(c[k]);
    out[o + 3] = 255;
  }
  return out;
}

function decode(bytes) {
  const rgb = new Float32Array(bytes.byteLength / 2);
  for (let i = 0; i < rgb.length; ++i) rgb[i] = kFloats[bytes.getUint16(2 * i, true)];
  return rgb;
}

function render({ model, el }) {
  const canvas = document.createElement("canvas"), bar = document.createElement("div");
  const slider = document.createElement("input"), choice = document.createElement("select");
  const text = document.createElement("span");
  Object.assign(slider, { type: "range", min: -10, max: 10, step: 0.25 });
  for (const name of ["aces", "reinhard", "srgb"]) choice.add(new Option(name));
  bar.append("exposure ", slider, " ", choice, " ", text);
  bar.style.font = text.style.font = "12px monospace";
  el.append(canvas, bar);

  let rgb = new Float32Array(0), pointer = null;
  const width = () => model.get("width"), height = () => model.get("height");
  function describe() {
    const stops = model.get("exposure");
    text.textContent = `${stops >= 0 ? "+" : ""}${stops} stops`;
    if (!pointer) return;
    const at = 3 * (pointer.y * width() + pointer.x);
    if (at < rgb.length)
      text.textContent += `  (${pointer.x}, ${pointer.y}): ` +
        Array.from(rgb.slice(at, at + 3), (v) => v.toPrecision(4)).join("  ");
  }
  function paint() {
    slider.value = model.get("exposure");
    choice.value = model.get("tone_operator");
    if (rgb.length === 3 * width() * height() && rgb.length > 0) {
      canvas.width = width();
      canvas.height = height();
      const codes = toneMapped(rgb, model.get("exposure"), model.get("tone_operator"));
      canvas.getContext("2d").putImageData(new ImageData(codes, width(), height()), 0, 0);
    }
    describe();
  }
  function load() {
    rgb = decode(model.get("pixels"));
    paint();
  }
  slider.oninput = () => {
    model.set("exposure", Number(slider.value));
    model.save_changes();
  };
  choice.onchange = () => {
    model.set("tone_operator", choice.value);
    model.save_changes();
  };
  canvas.onmousemove = (e) => {
    pointer = { x: Math.floor(e.offsetX), y: Math.floor(e.offsetY) };
    describe();
  };
  canvas.onmouseleave = () => {
    pointer = null;
    describe();
  };
  model.on("change:pixels change:width change:height", load);
  model.on("change:exposure change:tone_operator", paint);
  load();
}

export default { render };
