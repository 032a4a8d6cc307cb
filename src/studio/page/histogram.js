// @ts-check
// The distribution of a picture's luminance in stops, the exposure that fits it, and its largest value.

/** @typedef {import('./server.js').Picture} Picture */

/** Of all but the largest value, at most about so many pixels are looked at. */
const kMostSamples = 65536;
/** Stops of the first and last bin, and bins for each stop. */
const kLow = -20, kHigh = 20, kBins = 2;

/** @param {number} h A half float's bits. */
export function fromHalf(h) {
    const sign = h & 0x8000 ? -1 : 1, exponent = h >> 10 & 31, fraction = h & 1023;
    if (exponent === 31) return fraction ? NaN : sign * Infinity;
    return sign * (exponent ? (1 + fraction / 1024) * 2 ** (exponent - 15) : fraction * 2 ** -24);
}

/**
 * @typedef {{bins: number[], low: number, high: number, percentile: number, largest: number, dark: number, bad: number}} Histogram
 * `percentile`: the 95th; `dark` and `bad`: shares of the pixels that are not above 0, and not finite.
 */

/** The values of all half floats, by their bits. @type {Float32Array | null} */
let values16 = null;
const allHalves = () => values16 ??= Float32Array.from({length: 65536}, (_, h) => fromHalf(h));

/** @param {number} a @param {number} b @returns {number} */
const commonDivisor = (a, b) => b === 0 ? a : commonDivisor(b, a % b);

/**
 * The largest finite luminance of all pixels, without the scale; 0 where there is none.
 * @param {Picture} picture
 */
function largestOf({channels, halves}) {
    const value = allHalves();
    let largest = -Infinity;
    for (let i = 0; i < halves.length; i += channels) {
        const y = channels === 1 ? value[halves[i]] : 0.2126 * value[halves[i]] + 0.7152 * value[halves[i + 1]] + 0.0722 * value[halves[i + 2]];
        if (y > largest && y < Infinity) largest = y;
    }
    return largest === -Infinity ? 0 : largest;
}

/** @param {Picture} picture @returns {Histogram} */
export function histogramOf(picture) {
    const {channels, columns, halves, scale} = picture, pixels = halves.length / channels, value = allHalves(), factor = 2 ** scale;
    let step = Math.max(1, Math.floor(pixels / kMostSamples));
    // The sample has all columns.
    while (commonDivisor(step, columns) > 1) ++step;
    /** @type {number[]} */
    const values = [];
    const bins = Array.from({length: kBins * (kHigh - kLow)}, () => 0);
    let dark = 0, bad = 0, count = 0;
    for (let i = 0; i < pixels; i += step, ++count) {
        const v = (/** @type {number} */ c) => value[halves[channels * i + c]];
        const y = factor * (channels === 1 ? v(0) : 0.2126 * v(0) + 0.7152 * v(1) + 0.0722 * v(2));
        if (!Number.isFinite(y)) { ++bad; continue; }
        values.push(y);
        if (y <= 0) { ++dark; continue; }
        ++bins[Math.min(Math.max(Math.floor(kBins * (Math.log2(y) - kLow)), 0), bins.length - 1)];
    }
    values.sort((a, b) => a - b);
    return {bins: bins.map(n => n / Math.max(1, count)), low: kLow, high: kHigh, dark: dark / Math.max(1, count), bad: bad / Math.max(1, count),
        percentile: values[Math.floor(0.95 * (values.length - 1))] ?? 0, largest: factor * largestOf(picture)};
}

/**
 * The exposure, in stops, that the program chooses for pictures: the 95th percentile becomes 0.8.
 * @param {Histogram} h
 */
export const exposureFor = h => h.percentile > 0 ? Math.round(4 * Math.log2(0.8 / h.percentile)) / 4 : 0;

/**
 * Draws the bins over the stops; those that the exposure makes white are light.
 * @param {HTMLCanvasElement} canvas @param {Histogram | null} histogram @param {number} exposure
 */
export function drawHistogram(canvas, histogram, exposure) {
    const c = canvas.getContext('2d');
    if (!c || canvas.clientWidth === 0) return;
    [canvas.width, canvas.height] = [canvas.clientWidth * devicePixelRatio, canvas.clientHeight * devicePixelRatio];
    c.clearRect(0, 0, canvas.width, canvas.height);
    if (!histogram) return;
    const {bins, low, high} = histogram, first = bins.findIndex(b => b > 0), last = bins.length - 1 - [...bins].reverse().findIndex(b => b > 0);
    if (first < 0) return;
    // What is shown has a margin, and the place where white begins.
    const white = -exposure, from = Math.min(low + first / kBins - 1, white - 1), to = Math.max(low + (last + 1) / kBins + 1, white + 1);
    const x = (/** @type {number} */ stops) => (stops - from) / (to - from) * canvas.width;
    const largest = Math.max(...bins), text = 12 * devicePixelRatio, height = canvas.height - text - 2;
    bins.forEach((b, i) => {
        if (b === 0) return;
        const stops = low + i / kBins, h = Math.max(1, b / largest * height);
        c.fillStyle = stops >= white ? '#fff' : '#5b9bd5';
        c.fillRect(x(stops), height - h, Math.max(1, x(stops + 1 / kBins) - x(stops) - 1), h);
    });
    c.fillStyle = '#f90';
    c.fillRect(x(white), 0, Math.max(1, devicePixelRatio), height);
    c.fillStyle = '#aaa';
    c.font = `${text - 2}px sans-serif`;
    const step = Math.max(1, Math.ceil((to - from) / 8));
    for (let s = Math.ceil(from / step) * step; s <= Math.min(to, high); s += step) c.fillText(String(s), x(s), canvas.height - 2);
}
