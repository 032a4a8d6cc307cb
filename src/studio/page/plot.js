// @ts-check
// Estimated relative error over time, on logarithmic axes; the band is its 95 % confidence interval.

import {significant} from './controls.js';

const kNamespace = 'http://www.w3.org/2000/svg';
const kWidth = 330, kHeight = 200, kLeft = 46, kBottom = 26, kTop = 8, kRight = 8;
/** Distinct also without colours: by the dashes. */
const kStyles = [['#7db4ff', ''], ['#ffb070', '6 3'], ['#7ddc8b', '2 3'], ['#e59aff', '8 3 2 3'], ['#ffe07a', '4 4']];

/** @param {string} name @param {Record<string, string | number>} attributes @param {string} [text] */
function shape(name, attributes, text) {
    const e = document.createElementNS(kNamespace, name);
    for (const [key, value] of Object.entries(attributes)) e.setAttribute(key, String(value));
    if (text !== undefined) e.textContent = text;
    return e;
}

/**
 * Powers of ten, or with less than a decade, 1-2-5.
 * @param {number} low @param {number} high
 */
function ticks(low, high) {
    const all = [];
    for (let decade = Math.floor(Math.log10(low)); decade <= Math.ceil(Math.log10(high)); ++decade)
        for (const f of high / low > 30 ? [1] : [1, 2, 5]) {
            const v = f * 10 ** decade;
            if (v >= low && v <= high) all.push(v);
        }
    return all;
}

/** @param {HTMLElement} parent @param {any[]} runs Their `history` has [passes, seconds, error, low, high]. */
export function drawPlot(parent, runs) {
    const drawn = runs.filter(r => r.history.length > 1);
    if (drawn.length === 0) {
        parent.textContent = 'Once there are passes enough to estimate the error.';
        return;
    }
    const points = drawn.flatMap(r => r.history);
    const positive = (/** @type {number[]} */ values) => values.filter(v => v > 0);
    const times = positive(points.map(p => p[1])), errors = positive(points.flatMap(p => [p[2], p[3], p[4]]));
    const [x0, x1] = [Math.min(...times), Math.max(...times) * 1.001];
    const [y0, y1] = [Math.max(Math.min(...errors), Math.max(...errors) * 1e-4), Math.max(...errors)];
    const x = (/** @type {number} */ v) => kLeft + (kWidth - kLeft - kRight) * Math.log(v / x0) / Math.log(x1 / x0);
    const y = (/** @type {number} */ v) => kTop + (kHeight - kTop - kBottom) * Math.log(y1 / Math.max(v, y0)) / Math.log(y1 / y0);
    const last = drawn.map(r => `run ${r.id} ${significant(r.history[r.history.length - 1][2])}`).join(', ');
    const svg = shape('svg', {viewBox: `0 0 ${kWidth} ${kHeight}`, role: 'img', 'aria-label': `Relative error over seconds: ${last}`});
    for (const v of ticks(x0, x1)) {
        svg.append(shape('line', {x1: x(v), x2: x(v), y1: kTop, y2: kHeight - kBottom, stroke: '#444a57'}));
        svg.append(shape('text', {x: x(v), y: kHeight - kBottom + 14, 'text-anchor': 'middle'}, significant(v)));
    }
    for (const v of ticks(y0, y1)) {
        svg.append(shape('line', {x1: kLeft, x2: kWidth - kRight, y1: y(v), y2: y(v), stroke: '#444a57'}));
        svg.append(shape('text', {x: kLeft - 4, y: y(v) + 4, 'text-anchor': 'end'}, significant(v)));
    }
    svg.append(shape('text', {x: kWidth - kRight, y: kHeight - 1, 'text-anchor': 'end'}, 'seconds'));
    drawn.forEach((run, i) => {
        const [color, dashes] = kStyles[i % kStyles.length];
        const h = run.history;
        const band = [...h.map((/** @type {number[]} */ p) => `${x(p[1])},${y(p[4])}`), ...[...h].reverse().map((/** @type {number[]} */ p) => `${x(p[1])},${y(p[3])}`)];
        svg.append(shape('polygon', {points: band.join(' '), fill: color, opacity: 0.2}));
        svg.append(shape('polyline', {points: h.map((/** @type {number[]} */ p) => `${x(p[1])},${y(p[2])}`).join(' '), fill: 'none', stroke: color,
            'stroke-width': 1.5, 'stroke-dasharray': dashes}));
        const end = h[h.length - 1];
        svg.append(shape('text', {x: x(end[1]) - 3, y: y(end[2]) - 5, 'text-anchor': 'end'}, String(run.id)));
    });
    parent.replaceChildren(svg);
}
