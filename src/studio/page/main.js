// @ts-check
// The page: keeps the session's state, and connects the parts.

import {Server, Refusal} from './server.js';
import {View} from './view.js';
import {ImageList, KeptList, RunForm, RunList, describe, element, significant, viewOf} from './controls.js';
import {drawPlot} from './plot.js';
import {Space} from './space.js';
import {PathEditor} from './paths.js';
import {Inspector} from './inspector.js';
import {drawHistogram, exposureFor, histogramOf} from './histogram.js';

/** @param {string} id @returns {any} */
const at = id => document.getElementById(id);

const server = new Server(new URLSearchParams(location.hash.slice(1)).get('token') ?? '');

/** @type {any} */
let state = null;
/** @type {Map<number, any>} */
const runs = new Map();
/**
 * What the two places of the view show.
 * @typedef {{run: number, view: string, passes: number, isAsked: boolean, busy: boolean, again: boolean, isRefused: boolean}} Shown
 */
/** @type {[Shown, Shown | null]} */
const shown = [{run: 0, view: 'image', passes: 0, isAsked: false, busy: false, again: false, isRefused: false}, null];
/** The pictures that are drawn there, in words. They stay until those that are to be shown have come. */
const drawn = ['', ''];
/** Whether the pictures that are drawn are denoised. */
const drawnDenoised = [false, false];
/** @type {Space | null} */
let space = null;
/** @type {PathEditor | null} */
let editor = null;
/** @type {Inspector | null} */
let inspector = null;
let pane = 'image';
/**
 * Controls of the image.
 * @type {Record<string, any>}
 */
const tools = {};

// ---------------------------------------------------------------------------------------- messages

/** @type {Map<string, {text: string, action?: string, act?: () => void}>} */
const banners = new Map();

/**
 * Shows, or with an empty text takes away, a message.
 * @param {string} key @param {string} text @param {string} [action] @param {() => void} [act]
 */
function banner(key, text, action, act) {
    if (text) banners.set(key, {text, action, act});
    else banners.delete(key);
    const first = [...banners.values()][0];
    at('banner').hidden = !first;
    if (!first) return;
    if (at('banner-text').textContent !== first.text) at('banner-text').textContent = first.text;
    const button = at('banner-action');
    button.hidden = !first.action;
    button.textContent = first.action ?? '';
    button.onclick = first.act ?? null;
}

/** @param {Promise<any>} promise */
function report(promise) {
    promise.then(() => banner('failure', ''), e => banner('failure', e.message, 'Dismiss', () => banner('failure', '')));
}

// ---------------------------------------------------------------------------------------- image

const view = new View(at('view'), {pixel: () => showPixel(), trace: () => { traceBrightest(); }, wipe: w => { tools.wipe.value = w; }});
if (!view.hasGraphics) banner('graphics', 'This browser has no WebGL2: only numbers are shown.');

const kLabels = {image: '', error: 'relative standard error', denoised: 'denoised, not unbiased', first: 'first picture: albedo × cosine, no light yet'};

/**
 * The choice of views has no denoised image; the switch shows it in the place of the image.
 * @param {Shown} s
 */
const chosenView = s => s.view === 'denoised' ? 'image' : s.view;

/**
 * Requests a newer picture of one place. One request is under way at a time; a call in the meantime is made up for at its end.
 * @param {0 | 1} place
 */
async function refresh(place) {
    const s = shown[place];
    if (s?.busy) s.again = true;
    if (!s || s.busy || s.isRefused || document.hidden || !view.hasGraphics || !state?.scene) return;
    const isOfRun = s.run > 0 && (['image', 'denoised', 'error', 'variance'].includes(s.view) || s.view.includes(':'));
    if (!isOfRun && s.passes > 0) return;
    const run = runs.get(s.run);
    if (isOfRun && run && s.isAsked && run.snapshot <= s.passes && !s.view.includes(':')) return;
    s.busy = true;
    try {
        const query = {run: s.run, view: s.view, after: s.passes};
        const pixels = state.scene.width * state.scene.height, kCoarse = 1e6;
        // Without a run, only the first picture.
        const isMade = isOfRun || s.view !== 'image';
        // Coarse first.
        let picture = s.passes === 0 && isMade && pixels > kCoarse ? await server.image({...query, level: 2}) : null;
        if (picture && shown[place] === s) draw(place, picture, textOf(s, picture.passes));
        picture = (isMade ? await server.image(query) : null) ?? picture;
        if (shown[place] !== s) return;
        s.isAsked = picture === null;
        if (picture) {
            const isFirst = s.passes === 0;
            s.passes = Math.max(1, picture.passes);
            draw(place, picture, textOf(s, picture.passes));
            if ((isOfRun || openedIn(s)) && (place === 0 || isFirst)) showPixel();
        } else if (s.passes === 0 && place === 0 && chosenView(s) === 'image' && !view.pictures[0]) {
            const first = await server.image({view: 'first'});
            if (first && s.passes === 0 && shown[0] === s) draw(0, first, kLabels.first);
        }
    } catch (e) {
        if (e instanceof Refusal && e.status === 409 && shown[place] === s) {
            // An image of another size, as of a run of an earlier version of the scene.
            s.isRefused = true;
            draw(place, null, '');
        }
        if (e instanceof Refusal && e.status === 422 && s.view === 'denoised' && shown[place] === s && runs.has(s.run)) {
            banner('denoise', e.message, 'Dismiss', () => banner('denoise', ''));
            tools.denoise.checked = false;
            switchDenoising();
        } else if (e instanceof Refusal && e.status !== 503) banner('image', e.message, 'Dismiss', () => banner('image', ''));
    } finally {
        s.busy = false;
    }
    if (s.again) {
        s.again = false;
        await refresh(place);
    }
}

/**
 * The text of an option of the choice of views.
 * @param {string} view
 */
const optionText = view => [...tools.view.options].find((/** @type {any} */ o) => o.value === view)?.textContent ?? view;

/**
 * The opened image that a place shows.
 * @param {Shown | null} s
 */
const openedIn = s => state?.images.find((/** @type {any} */ i) => viewOf(i.id) === s?.view) ?? null;

/** @param {Shown} s @param {number} passes */
function textOf(s, passes) {
    if (s.view === 'reference') return 'reference';
    const opened = openedIn(s);
    if (opened) return opened.file;
    return [s.run > 0 ? `run ${s.run}` : '', /** @type {any} */ (kLabels)[s.view] ?? optionText(s.view), s.run > 0 && passes > 0 ? `${passes} spp` : ''].filter(Boolean).join(', ');
}

/** @param {0 | 1} place @param {import('./server.js').Picture | null} picture @param {string} text */
function draw(place, picture, text) {
    view.show(place, picture);
    const s = shown[place];
    drawnDenoised[place] = !!picture && (s?.view === 'denoised' || /denoised/.test(openedIn(s)?.note ?? ''));
    if (place === 0) updateHistogram(picture);
    drawn[place] = text;
    label();
}

function label() {
    const texts = shown.map((s, i) => !s ? '' : s.passes > 0 || s.isRefused || (i === 0 && drawn[0] === kLabels.first) ? drawn[i]
        : [drawn[i], `${textOf(s, 0) || 'the image'} is awaited`].filter(Boolean).join('; '));
    at('label').textContent = shown[1] ? `${view.isFlipped ? 'right | left' : 'left | right'}: ${texts[0]} | ${texts[1]}` : texts[0];
}

/** @param {0 | 1} place @param {number} run @param {string} what */
function showIn(place, run, what) {
    if (place === 0 && run > 0 && what === 'image' && tools.denoise.checked) what = 'denoised';
    if (place === 0 || run > 0 || what === 'reference' || what.startsWith('opened:')) shown[place] = {run, view: what, passes: 0, isAsked: false, busy: false, again: false, isRefused: false};
    else shown[1] = null;
    tools.measured.textContent = '';
    tools.measure.disabled = !shown[1];
    if (place === 1 && !shown[1]) draw(1, null, '');
    label();
    refresh(place);
    updateRuns();
    // Another run has other techniques.
    if (place === 0 && tools.listed?.run !== run) updateViewOptions().catch(() => {});
}

/**
 * Of the first picture.
 * @type {import('./histogram.js').Histogram | null}
 */
let histogram = null;

/** @param {import('./server.js').Picture | null} picture */
function updateHistogram(picture) {
    histogram = picture && histogramOf(picture);
    view.white = histogram?.largest || 1;
    showHistogram();
}

function showHistogram() {
    if (pane !== 'image') return;
    drawHistogram(at('histogram'), histogram, view.exposure);
    const share = (/** @type {number} */ v) => v > 0 && v < 0.001 ? '< 0.1 %' : `${significant(100 * v, 2)} %`;
    at('histogram-text').textContent = histogram ? `stops; white begins at the line. Largest ${significant(histogram.largest, 3)}, 95 % below ${significant(histogram.percentile, 3)}`
        + (histogram.dark > 0 ? `, ${share(histogram.dark)} not above 0` : '') + (histogram.bad > 0 ? `, ${share(histogram.bad)} not finite` : '') : '';
}

// ---------------------------------------------------------------------------------------- worst pixels

/**
 * Traces again what made a pixel of a run bright in its brightest pass, and shows the run.
 * @param {number} run @param {any} worst As the program describes it.
 */
async function traceWorst(run, {x, y, pass, value}) {
    if (shown[0].run !== run) {
        showIn(0, run, 'image');
        tools.view.value = 'image';
    }
    view.corner = null;
    view.moveCursor(x, y);
    showPane('paths');
    inspector?.setPixel(x, y, run);
    await inspector?.replayPass(pass, value);
}

/** Traces again what made the selected pixel of the shown run bright, or all of its paths if that is unknown. */
async function traceBrightest() {
    const run = shown[0].run, [x, y] = view.cursor;
    if (!runs.has(run)) return;
    const {pixel} = await server.get(`/v1/worst?run=${run}&x=${x}&y=${y}`).catch(() => ({pixel: null}));
    if (pixel) return traceWorst(run, pixel);
    view.corner = null;
    showPane('paths');
    inspector?.setPixel(x, y, run);
    await inspector?.replay();
}

const percent = (/** @type {number} */ share) => `${Math.round(100 * share)} %`;

/** Lists the pixels of the shown run that owe most to one pass. */
async function listWorst() {
    const run = shown[0].run, list = tools.worstList;
    if (run === 0) return;
    try {
        const {passes, pixels} = await server.get(`/v1/worst?run=${run}&count=20`);
        tools.worstText.textContent = pixels.length > 0 ? `run ${run}, ${passes} passes: what one pass made of the pixel` : `run ${run}: nothing is known, as of chains, of several seeds, and before the second pass`;
        list.replaceChildren(...pixels.map((/** @type {any} */ w) => element('button', {type: 'button', textContent: `(${w.x}, ${w.y}) pass ${w.pass}: ${percent(w.share)}, luminance ${significant(w.value, 3)}`,
            title: 'Trace its paths in this pass again', onclick: () => { traceWorst(run, w); }, onfocus: () => { view.corner = null; view.moveCursor(w.x, w.y); }})));
    } catch (e) {
        tools.worstText.textContent = /** @type {Error} */ (e).message;
    }
}

// ---------------------------------------------------------------------------------------- what is rendered

/**
 * What follows when the scene is loaded with another view.
 * @type {(() => Promise<any>) | null}
 */
let afterLoad = null;

/** Files are named, not addressed. */
const kFolders = /user_paths=(?:\\.|[^,\\])*\//;

/**
 * Has the program load the scene with another camera, region or sensor, and render it by the method that is shown.
 * @param {any} change
 */
async function changeView(change) {
    const run = runs.get(shown[0].run) ?? runs.get(newest());
    await server.post('/v1/run', {action: 'view', ...change});
    afterLoad = async () => {
        const integrator = (run?.integrator ?? '').replace(kFolders, 'user_paths=');
        await begin({action: 'start', integrator, ...(run?.sampler ? {sampler: run.sampler} : {})});
        banner('image', '');
    };
}

/** Renders the selected rectangle alone. */
function renderRegion() {
    const {x, y, w, h} = view.selected(), [cx, cy] = state.scene.crop;
    if (w * h > 1) report(changeView({crop: {x: x + cx, y: y + cy, w, h}}));
}

/** The whole image: without a rectangle, it would be the part that the file or the command line says. */
function whole() {
    const [w, h] = state.scene.whole;
    return {x: 0, y: 0, w, h};
}

/** Shows the image of the run with its noise, or without. */
function switchDenoising() {
    if (chosenView(shown[0]) === 'image') showIn(0, shown[0].run, 'image');
    updateDenoising();
}

/** Says where denoising gains little. */
function updateDenoising() {
    const run = runs.get(shown[0].run);
    tools.spread.hidden = !(tools.denoise.checked && run?.filter_mode === 'spread' && state?.scene?.filter_is_wide);
}

/** Renders by the method that is shown, so that the errors of pixels are independent. */
async function startSampling() {
    const run = runs.get(shown[0].run);
    if (run) await begin({action: 'start', integrator: run.integrator.replace(kFolders, 'user_paths='), sampler: run.sampler, seed: run.seed, filter_mode: 'sample'});
}

async function savePicture() {
    const ending = drawnDenoised.some(Boolean) ? '.denoised.png' : '.png';
    const png = await view.png();
    if (!png) return;
    const link = element('a', {href: URL.createObjectURL(png), download: (state?.scene_file ?? 'picture').replace(/\.[^.]*$/, '') + ending});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/** The values of the selected pixel or rectangle, a line for each picture: the place, red, green, blue. */
let values = '';

async function copyValues() {
    if (!values) return;
    try {
        await navigator.clipboard.writeText(values);
    } catch {
        // Pages by the name of another machine have no clipboard.
        const area = element('textarea', {value: values});
        document.body.append(area);
        area.select();
        document.execCommand('copy');
        area.remove();
    }
    at('spoken').textContent = `copied: ${values}`;
    at('copied').textContent = 'copied';
}

let pixelRequest = 0;
/** Shows the values of the selected pixel or rectangle. */
async function showPixel() {
    const request = ++pixelRequest;
    const {x, y, w, h} = view.selected();
    const isPixel = w * h === 1;
    /** @type {string[]} */
    const lines = [];
    const parts = [element('div', {textContent: isPixel ? `(${x}, ${y})` : `(${x}, ${y}) to (${x + w - 1}, ${y + h - 1}): ${w} × ${h} pixels`})];
    const describePixel = async (/** @type {Shown | null} */ s) => {
        const opened = openedIn(s);
        if (!s || (s.run === 0 && !opened)) return;
        const isDenoised = s.view === 'denoised', source = opened ? `view=${s.view}` : isDenoised ? `view=denoised:${s.run}` : `run=${s.run}`;
        const p = await server.get(`/v1/pixel?${source}&x=${x}&y=${y}&w=${w}&h=${h}`).catch(() => null);
        if (!p?.passes) return;
        const kNames = {confidence: '± 95 %', upper: '± upper bound (sobol)', 'noise only': '± noise only, without bias', none: isDenoised ? 'denoised, not unbiased' : opened ? 'no interval' : runs.get(s.run)?.seeds ? 'no interval: several seeds' : 'no interval: one chain'};
        const cells = (/** @type {string} */ scope, /** @type {string} */ name, /** @type {string[]} */ values) => element('tr', {}, [element('th', {scope, textContent: name}),
            ...values.map(textContent => element(scope === 'col' ? 'th' : 'td', {textContent}))]);
        const mean = isPixel && p.nan + p.infinite > 0 ? p.mean.map(() => p.nan > 0 ? 'nan' : 'inf')
            : p.mean.map((/** @type {number} */ v) => Number.isFinite(v) ? Number(v.toPrecision(7)) : v);
        lines.push([x, y, ...(isPixel ? [] : [w, h]), ...mean, ...(isDenoised ? ['denoised'] : [])].join(' '));
        const kChannels = ['red', 'green', 'blue'];
        // A pixel has few values; those of a rectangle need a row each.
        const statistics = {mean: p.mean, '±': p.half, least: p.least, largest: p.largest, variance: p.variance, reference: p.reference};
        const rows = isPixel
            ? kChannels.map((name, c) => cells('row', name, [significant(p.mean[c], 6), p.half ? `± ${significant(p.half[c], 3)}` : '', p.reference ? `reference ${significant(p.reference[c], 6)}` : '']))
            : [cells('col', '', kChannels), ...Object.entries(statistics).filter(([, v]) => v).map(([name, v]) => cells('row', name, v.map((/** @type {number} */ x) => significant(x, 4))))];
        parts.push(element('div', {className: 'soft', textContent: `${opened ? [opened.file, opened.note].filter(Boolean).join(', ') : `run ${s.run}, ${p.passes} spp`}, ${/** @type {any} */ (kNames)[p.interval]}`}));
        parts.push(element('table', {}, rows));
        if (p.nan + p.infinite > 0) parts.push(element('div', {className: 'error', textContent: `left out: ${p.nan} pixels NaN, ${p.infinite} infinite`}));
    };
    await describePixel(shown[0]);
    if (shown[0].view === 'denoised' && shown[1]?.run !== shown[0].run) await describePixel({...shown[0], view: 'image'});
    await describePixel(shown[1]);
    if (lines.length > 0) parts.push(element('div', {className: 'bar'}, [element('button', {type: 'button', id: 'copy-values', textContent: 'Copy', title: 'Copy the place and the mean of each picture (C)', onclick: () => { copyValues(); }}),
        element('span', {id: 'copied', className: 'soft'})]));
    // The run may have been removed meanwhile.
    const run = shown[0].run;
    if (isPixel && runs.has(run)) {
        const {pixel} = await server.get(`/v1/worst?run=${run}&x=${x}&y=${y}`).catch(() => ({pixel: null}));
        if (pixel) parts.push(element('div', {className: 'bar'}, [element('span', {className: 'soft', textContent: `brightest in pass ${pixel.pass}: ${percent(pixel.share)} of its sum`}),
            element('button', {type: 'button', id: 'trace-brightest', textContent: 'Trace it', onclick: () => { traceWorst(run, pixel); }})]));
    }
    if (request !== pixelRequest) return;
    values = lines.join('\n');
    tools.region.disabled = w * h === 1;
    at('pixel').replaceChildren(...parts);
    inspector?.setPixel(view.cursor[0], view.cursor[1], shown[0].run);
}

/** Has the program measure how far the two images are apart. */
async function measure() {
    const [a, b] = shown;
    if (!b) return;
    tools.measured.textContent = '…';
    try {
        const key = (/** @type {Shown} */ s) => s.view === 'denoised' ? `denoised:${s.run}` : s.run > 0 ? s.run : s.view;
        const name = (/** @type {Shown} */ s, /** @type {number} */ passes) => s.view === 'reference' ? 'the reference' : openedIn(s)?.file ?? `run ${s.run}${s.view === 'denoised' ? ' denoised' : ''}, ${passes} spp`;
        const d = await server.get(`/v1/difference?run=${key(a)}&against=${key(b)}`);
        tools.measured.textContent = `relMSE ${significant(d.rel_mse)}, FLIP ${significant(d.flip)}: ${name(a, d.passes)}, against ${name(b, d.against_passes)}`
            + (d.not_finite ? `; ${d.not_finite} pixels that are not finite are left out of relMSE` : '');
    } catch (e) {
        tools.measured.textContent = /** @type {Error} */ (e).message;
    }
}

function makeTools() {
    const number = (/** @type {any} */ properties) => element('input', {type: 'range', ...properties});
    tools.exposure = number({id: 'exposure', min: -kMostStops, max: kMostStops, step: 0.25, value: 0, oninput: () => setExposure(Number(tools.exposure.value))});
    tools.exposureText = element('output', {textContent: '0'});
    tools.view = element('select', {id: 'view-choice', onfocus: () => updateViewOptions().catch(() => {}), onchange: () => showIn(0, shown[0].run || newest(), tools.view.value)});
    tools.mode = element('select', {id: 'mode', onchange: () => { view.mode = Number(tools.mode.value); view.redraw(); }},
        ['colours', 'false colours', 'relative difference', 'signed difference', 'squared difference'].map((t, i) => element('option', {value: i, textContent: t})));
    tools.against = element('select', {id: 'against', onchange: () => {
        const value = tools.against.value;
        if (value === 'reference' || value.startsWith('opened:')) showIn(1, 0, value);
        else showIn(1, Number(value), 'image');
    }});
    tools.wipe = number({id: 'wipe', min: 0, max: 1, step: 0.01, value: 0.5, oninput: () => { view.wipe = Number(tools.wipe.value); view.redraw(); }});
    tools.measure = element('button', {type: 'button', textContent: 'Measure', title: 'relMSE and FLIP of the two images', disabled: true, onclick: measure});
    tools.measured = element('output', {});
    tools.tone = element('select', {id: 'tone', onchange: () => { view.tone = Number(tools.tone.value); view.redraw(); }},
        ['sRGB', 'ACES', 'Reinhard'].map((t, i) => element('option', {value: i, textContent: t})));
    tools.channel = element('select', {id: 'channel', onchange: () => { view.channel = Number(tools.channel.value); view.redraw(); }},
        ['all', 'red', 'green', 'blue', 'luminance'].map((t, i) => element('option', {value: i, textContent: t})));
    tools.auto = element('button', {type: 'button', id: 'auto-exposure', textContent: 'Auto', title: 'The exposure that fits the image', onclick: () => { if (histogram) setExposure(exposureFor(histogram)); }});
    tools.region = element('button', {type: 'button', id: 'render-region', textContent: 'Render region', title: 'Render the selected rectangle alone', disabled: true, onclick: renderRegion});
    tools.whole = element('button', {type: 'button', id: 'render-whole', textContent: 'Render all', title: 'Render the whole image again', hidden: true, onclick: () => report(changeView({crop: whole()}))});
    tools.camera = element('button', {type: 'button', id: 'file-camera', textContent: 'Camera of the file', title: 'Put the camera back', hidden: true, onclick: () => report(changeView({camera: null}))});
    tools.sensor = element('select', {id: 'sensor', onchange: () => report(changeView({sensor: Number(tools.sensor.value)}))});
    tools.sensorLabel = element('label', {hidden: true}, ['sensor ', tools.sensor]);
    tools.worstText = element('p', {className: 'soft'});
    tools.worstList = element('div', {className: 'replayed', role: 'group', 'aria-label': 'Pixels by what one pass made of them'});
    at('worst').append(element('button', {type: 'button', id: 'find-worst', textContent: 'Find', onclick: () => { listWorst(); }}), tools.worstText, tools.worstList);
    tools.denoise = element('input', {type: 'checkbox', id: 'denoise', onchange: switchDenoising});
    tools.spread = element('span', {id: 'denoise-spread', className: 'note', hidden: true}, ['filter mode spread: pixels share errors, so denoising gains less ',
        element('button', {type: 'button', id: 'start-sampling', textContent: 'Start with filter mode sample', title: 'A new run of this method, whose samples contribute to one pixel each', onclick: () => report(startSampling())})]);
    const field = (/** @type {string} */ text, /** @type {any} */ input, /** @type {any[]} */ ...more) => element('label', {}, [`${text} `, input, ...more]);
    at('view-tools').append(field('show', tools.view), element('label', {title: 'Show the image of the run without its noise: biased, and not what is saved'}, [tools.denoise, ' denoise']), tools.spread, field('exposure', tools.exposure, ' ', tools.exposureText), tools.auto, field('as', tools.mode), field('channels', tools.channel), field('tone', tools.tone),
        field('compare with', tools.against), field('wipe', tools.wipe),
        element('button', {type: 'button', textContent: 'Flip', onclick: flip}), element('button', {type: 'button', textContent: 'Whole image', onclick: () => view.resetZoom()}),
        tools.measure, element('button', {type: 'button', id: 'save-picture', textContent: 'Save picture', title: 'The picture as it is shown, as a PNG file', onclick: () => { savePicture(); }}),
        tools.region, tools.whole, tools.camera, tools.sensorLabel, tools.measured);
}

/** So many that scenes in any units can be seen. */
const kMostStops = 24;

/** @param {number} stops */
function setExposure(stops) {
    view.exposure = Math.min(Math.max(stops, -kMostStops), kMostStops);
    tools.exposure.value = view.exposure;
    tools.exposureText.textContent = String(view.exposure);
    showHistogram();
    view.redraw();
}

function flip() {
    if (!view.pictures[1]) return;
    view.isFlipped = !view.isFlipped;
    // The wipe would show a part of each.
    view.wipe = 1;
    tools.wipe.value = 1;
    label();
    view.redraw();
}

const newest = () => Math.max(0, ...runs.keys());

/**
 * Sets the options of a select element; keeps its value if it is among them.
 * @param {any} select @param {[string, string][]} options @param {string} fallback
 */
function setOptions(select, options, fallback) {
    const key = JSON.stringify(options);
    if (select.dataset.key === key) return;
    select.dataset.key = key;
    const before = select.value || fallback;
    select.replaceChildren(...options.map(([value, text]) => element('option', {value, textContent: text})));
    select.value = options.some(o => o[0] === before) ? before : fallback;
}

async function updateViewOptions() {
    /** @type {[string, string][]} */
    const options = [['image', 'image'], ['error', 'relative error'], ...state.layers.map((/** @type {any} */ l) => [l.name, l.name])];
    const run = runs.get(shown[0].run);
    tools.listed = {run: shown[0].run, passes: run?.passes ?? 0};
    if (run?.techniques > 0 && run.passes > 0) {
        const {techniques} = await server.get(`/v1/techniques?run=${run.id}`);
        const lengths = [...new Set(techniques.map((/** @type {any} */ t) => t.edges))].sort((a, b) => a - b);
        for (const edges of lengths) options.push([`length:${edges}`, `paths of ${edges} edges`]);
        for (const t of techniques) {
            const text = `${t.strategy} s=${t.s} t=${t.t} (${t.edges} edges)`;
            options.push([`technique:${t.key}`, `${text}, weighted`], [`unweighted:${t.key}`, `${text}, unweighted`]);
        }
        if (tools.listed.run !== shown[0].run) return;
    }
    const opened = openedIn(shown[0]);
    if (opened) options.push([shown[0].view, opened.file]);
    setOptions(tools.view, options, 'image');
    if (!options.some(([value]) => value === chosenView(shown[0]))) showIn(0, shown[0].run, 'image');
    tools.view.value = chosenView(shown[0]);
}

// ---------------------------------------------------------------------------------------- runs

const list = new RunList(at('run-list'), {act, shown: () => shown[0].run, show: run => showIn(0, run, openedIn(shown[0]) ? 'image' : tools.view.value || 'image')});

const kept = new KeptList(at('kept-list'), {open: file => report(begin({action: 'open', file})), look: () => report(server.post('/v1/run', {action: 'list'}))});

const images = new ImageList(at('image-list'), {open: files => report(openImages(files)), show: showOpened,
    remove: id => report(server.removeImage(id)), shown: () => shown[0].view});

/** @param {number} id */
function showOpened(id) {
    showIn(0, 0, viewOf(id));
    report(updateViewOptions());
}

/**
 * Opens files one after the other, and shows the last one that is an image.
 * @param {File[]} files
 */
async function openImages(files) {
    let last = 0;
    const problems = [];
    for (const file of files)
        try {
            last = await server.openImage(file, state.most_file_bytes);
        } catch (e) {
            const problem = /** @type {Error} */ (e).message;
            problems.push(problem.includes(file.name) ? problem : `${file.name}: ${problem}`);
        }
    await update();
    if (last > 0) showOpened(last);
    if (problems.length > 0) throw new Error(problems.join('; '));
}

function updateRuns() {
    const all = [...runs.values()];
    list.update(all);
    /** @type {[string, string][]} */
    const others = [['0', 'nothing'], ...all.map(r => /** @type {[string, string]} */ ([String(r.id), `run ${r.id}: ${r.integrator}`]))];
    if (state?.has_reference) others.push(['reference', 'reference']);
    for (const i of state?.images ?? []) others.push([viewOf(i.id), i.file]);
    images.update(state?.images ?? [], state?.scene);
    updateDenoising();
    setOptions(tools.against, others, '0');
    if (pane === 'image') drawPlot(at('plot'), all);
}

/** @param {number} run @param {string} name */
async function save(run, name) {
    const send = (/** @type {boolean} */ overwrite) => server.post('/v1/save', {run, file: name, overwrite});
    const {file, passes} = await send(false).catch(e => {
        if (e instanceof Refusal && e.status === 409 && confirm(`${e.message}. Replace it?`)) return send(true);
        throw e;
    });
    const text = `${file}: ${passes} spp saved.`, kSeconds = 6;
    banner('saved', text);
    at('spoken').textContent = text;
    setTimeout(() => banner('saved', ''), 1000 * kSeconds);
}

/** @param {string} action @param {number} run */
function act(action, run) {
    if (action === 'save') {
        const name = prompt('Name of the file in the output folder (.exr, .pfm, .hdr or .png)', `run-${run}.exr`);
        if (name) report(save(run, name));
        return;
    }
    const r = runs.get(run);
    /** @type {any} */
    const request = {action, run};
    // A run that has reached its limit goes on to the double of it.
    // One with several seeds goes on with more of them.
    if (action === 'continue' && r?.state === 'finished' && r.seeds[1] === 1) request.spp = 2 * r.passes;
    report(server.post('/v1/run', request));
}

/**
 * Starts or opens a run, and shows it.
 * @param {any} request @returns {Promise<number>}
 */
async function begin(request) {
    const {run} = await server.post('/v1/run', request);
    await update();
    showIn(0, run, 'image');
    tools.view.value = 'image';
    return run;
}

// ---------------------------------------------------------------------------------------- state

async function update() {
    const before = state?.scene_version ?? 0, problemBefore = state?.reference_problem ?? '';
    state = await server.get('/v1/state');
    for (const r of state.runs) runs.set(r.id, r);
    for (const id of runs.keys()) if (!state.runs.some((/** @type {any} */ r) => r.id === id)) runs.delete(id);
    at('scene-name').textContent = state.scene ? `${state.scene_file}, ${state.scene.width} × ${state.scene.height}` : `${state.scene_file} is being loaded`;
    banner('load', state.load_error);
    if (state.reference_problem !== problemBefore) banner('reference', state.reference_problem, 'Dismiss', () => banner('reference', ''));
    at('kept-list').hidden = !state.keeps_runs;
    kept.update(state.kept);
    if (state.scene) view.setSize(state.scene.width, state.scene.height);
    if (!tools.form) {
        tools.form = new RunForm(at('run-form'), state.integrators, {start: async request => { await begin(request); }});
        if (state.scene) tools.form.choose(state.scene.integrator);
    }
    await updateViewOptions();
    updateRuns();
    if (state.scene) {
        const {whole, width, height, sensors, sensor, has_own_camera: hasOwnCamera} = state.scene;
        tools.whole.hidden = whole[0] === width && whole[1] === height;
        tools.camera.hidden = !hasOwnCamera;
        tools.sensorLabel.hidden = sensors.length < 2;
        setOptions(tools.sensor, sensors.map((/** @type {string} */ name, /** @type {number} */ i) => [String(i), `${i}: ${name}`]), String(sensor));
        tools.sensor.value = String(sensor);
    }
    if (state.load_error) afterLoad = null;
    if (before > 0 && state.scene_version !== before) {
        showOtherScene(state.scene);
        const next = afterLoad;
        afterLoad = null;
        if (next) report(next());
    }
}

/**
 * Shows another version of the scene: pictures, geometry and verdicts are of the earlier one.
 * @param {any} scene
 */
function showOtherScene(scene) {
    const [one, other] = shown;
    showIn(0, one.run, one.view);
    if (other) showIn(1, other.run, other.view);
    inspector?.clear();
    space?.setScene(scene);
    if (space) report(space.load());
    editor?.run(() => /** @type {PathEditor} */ (editor).check());
}

/** @param {any} event */
async function onEvent(event) {
    const isNew = event.runs.length !== runs.size || event.runs.some((/** @type {any} */ r) => !runs.has(r.id)) || event.scene_version !== state.scene_version
        || event.load_error !== state.load_error || event.kept_version !== state.kept_version || event.images_version !== state.images_version;
    if (isNew) await update();
    for (const r of event.runs) {
        const run = runs.get(r.id);
        if (!run) continue;
        const hadError = run.error;
        Object.assign(run, r);
        const last = run.history[run.history.length - 1];
        if (r.error && (!hadError || !last || r.seconds > 1.05 * last[1])) run.history.push([r.passes, r.seconds, ...r.error]);
    }
    banner('changed', event.scene_changed ? 'The scene changed on the disk.' : '', 'Load it again', () => report(server.post('/v1/run', {action: 'reload'})));
    if (shown[0].run === 0 && runs.size > 0 && !openedIn(shown[0])) showIn(0, newest(), 'image');
    if (shown[1]?.view.startsWith('opened:') && !openedIn(shown[1])) showIn(1, 0, '');
    if (shown[0].run > 0 && !runs.has(shown[0].run) && runs.size > 0) showIn(0, newest(), 'image');
    // More techniques are found as the run goes on.
    const run = runs.get(shown[0].run);
    if (run?.techniques > 0 && run.passes > 0 && (!tools.view.dataset.key?.includes('technique:') || run.passes >= 2 * tools.listed.passes)) await updateViewOptions();
    updateRuns();
    editor?.onEvent();
    await Promise.all([refresh(0), refresh(1)]);
}

/** Follows the session for as long as the page is open. */
async function follow() {
    let since = null;
    for (;;) {
        try {
            await update();
            banner('connection', '');
            since = null;
            await server.listen(event => { onEvent(event).catch(() => {}); });
        } catch (e) {
            const status = e instanceof Refusal ? e.status : 0;
            if (status === 401) {
                banner('connection', /** @type {Error} */ (e).message);
                return;
            }
            since ??= new Date();
            banner('connection', status === 429 ? /** @type {Error} */ (e).message
                : `The program does not answer since ${since.toLocaleTimeString()}; the picture is the last one. Trying again.`);
            await new Promise(r => setTimeout(r, status === 429 ? 5000 : 1000));
        }
    }
}

// ---------------------------------------------------------------------------------------- panes and keys

/** @param {string} name */
function showPane(name) {
    pane = name;
    for (const p of ['image', 'paths']) {
        at(`pane-${p}`).hidden = p !== name;
        at(`tab-${p}`).setAttribute('aria-selected', String(p === name));
        at(`tab-${p}`).tabIndex = p === name ? 0 : -1;
    }
    for (const id of ['editor-section', 'inspector-section']) at(id).hidden = name !== 'paths';
    for (const id of ['plot-section', 'run-form', 'histogram-section', 'worst-section']) at(id).hidden = name !== 'image';
    if (name === 'paths' && !space && state?.scene) {
        space = new Space(at('space'), at('space-tools'), at('space-label'), server, state.scene);
        editor = new PathEditor(at('editor'), space, server, {
            pixel: () => ({x: view.cursor[0], y: view.cursor[1]}), start: begin, runs: () => runs, fail: text => banner('editor', text, 'Dismiss', () => banner('editor', ''))});
        space.tell.say = text => { at('spoken').textContent = text; };
        space.tell.render = camera => { showPane('image'); report(changeView({camera})); };
        inspector = new Inspector(at('inspector'), space, server, editor);
        inspector.setPixel(view.cursor[0], view.cursor[1], shown[0].run);
        report(space.load());
    }
    showHistogram();
    if (name === 'image') view.redraw();
    else space?.redraw();
}
for (const name of ['image', 'paths']) at(`tab-${name}`).onclick = () => showPane(name);
document.querySelector('[role=tablist]')?.addEventListener('keydown', e => {
    const key = /** @type {KeyboardEvent} */ (e).key;
    if (key !== 'ArrowLeft' && key !== 'ArrowRight') return;
    showPane(pane === 'image' ? 'paths' : 'image');
    at(`tab-${pane}`).focus();
});

const help = at('help');
at('help-button').onclick = () => help.showModal();

document.addEventListener('keydown', e => {
    const target = /** @type {HTMLElement} */ (e.target);
    if (help.open || target.closest('input:not([type=range]):not([type=checkbox]), select, textarea')) return;
    if (editor && pane === 'paths' && editor.onKey(e)) return e.preventDefault();
    if (e.ctrlKey || e.altKey || e.metaKey) return;
    if (e.key === ' ' && !target.closest('button, summary, input')) {
        const run = runs.get(shown[0].run);
        if (run) act(run.state === 'rendering' ? 'stop' : 'continue', run.id);
    } else if (e.key === 'f') flip();
    else if (e.key === 'c' && pane === 'image') copyValues();
    else if (e.key === 'd' && pane === 'image') tools.denoise.click();
    else if (e.key === '+' || e.key === '=') setExposure(view.exposure + 0.5);
    else if (e.key === '-') setExposure(view.exposure - 0.5);
    else if (e.key === '?') help.showModal();
    else return;
    e.preventDefault();
});
// Anywhere on the page: the browser would leave it for a file that is dropped beside the image.
const bringsFiles = (/** @type {DragEvent} */ e) => e.dataTransfer?.types.includes('Files');
document.addEventListener('dragover', e => { if (bringsFiles(e)) e.preventDefault(); });
document.addEventListener('drop', e => {
    if (!bringsFiles(e)) return;
    e.preventDefault();
    report(openImages([...e.dataTransfer?.files ?? []]));
});

document.addEventListener('visibilitychange', () => { refresh(0); refresh(1); });

const kSpokenInterval = 10000;
setInterval(() => {
    const run = runs.get(shown[0].run);
    if (run && run.state === 'rendering') at('spoken').textContent = `Run ${run.id}: ${describe(run)}`;
}, kSpokenInterval);

makeTools();
showPane('image');
if (server.token) follow();
else banner('connection', 'The address has no token; open the one that the program printed.');

// For tests and for curious users of the console.
Object.assign(window, {studio: {view, server, runs, shown, space: () => space, editor: () => editor, inspector: () => inspector, state: () => state}});
