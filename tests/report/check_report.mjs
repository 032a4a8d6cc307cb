// Opens a report of `etendue compare` in a headless browser and uses it: images appear, slider, zoom, panning, insets,
// exposure and maps change what is drawn, and the browser has nothing to complain about.
//
//     node check_report.mjs report.html [folder for screenshots]
//
// Needs Node.js and Chromium; see browser.mjs.

import {mkdirSync} from 'node:fs';
import {resolve} from 'node:path';
import {pathToFileURL} from 'node:url';

import {Browser} from '../support/browser.mjs';

const [reportFile, screenshots] = process.argv.slice(2);
if (!reportFile) {
    console.error('usage: check_report.mjs report.html [folder for screenshots]');
    process.exit(2);
}

let failures = 0;
function check(holds, what) {
    console.log(`${holds ? 'ok  ' : 'FAIL'} ${what}`);
    if (!holds) ++failures;
}

/// The first scene's viewer, from the page's side.
const viewer = "document.querySelector('.viewer').viewer";
/// What the first pane shows, as one number for each pixel of a coarse grid.
const pixels = `(() => {
    const c = document.querySelector('.pane canvas');
    // A copy, since reading often from the page's own canvas would make the browser complain.
    const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});
    const context = copy.getContext('2d', {willReadFrequently: true});
    context.drawImage(c, 0, 0);
    const d = context.getImageData(0, 0, c.width, c.height).data;
    const out = [];
    for (let y = 8; y < c.height; y += 16) for (let x = 8; x < c.width; x += 16) {
        const at = 4 * (y * c.width + x);
        out.push(d[at] + d[at + 1] + d[at + 2]);
    }
    return out;
})()`;
const average = values => values.reduce((a, b) => a + b, 0) / values.length;
const differs = (a, b) => a.length !== b.length || a.some((v, i) => v !== b[i]);
const button = text => `[...document.querySelectorAll('.viewer button')].find(b => b.textContent === '${text}')`;

async function choose(browser, label, option) {
    await browser.evaluate(`(() => {
        const label = [...document.querySelectorAll('.viewer label')].find(l => l.firstChild.textContent === '${label}');
        const select = label.querySelector('select');
        select.value = [...select.options].find(o => o.textContent === '${option}').value;
        select.dispatchEvent(new Event('change'));
    })()`);
    await browser.settle();
}

async function run(browser) {
    await browser.open(pathToFileURL(resolve(reportFile)).href);
    await browser.screenshot('1-top');
    const scenes = await browser.evaluate('report.scenes.length');
    check(scenes > 0, `the report has scenes: ${scenes}`);
    const rows = await browser.evaluate("document.querySelectorAll('section:first-of-type table.figures tbody tr').length");
    check(rows === await browser.evaluate('report.scenes[0].methods.length'), `a row for each method: ${rows}`);
    check(await browser.evaluate(`(async () => { const i = document.querySelector('.plots img'); await i.decode();
        return i.naturalWidth > 300; })()`), 'the convergence plot is an image');

    await browser.evaluate("document.querySelector('.plots').scrollIntoView()");
    await browser.until("document.querySelector('.viewer')", 'the viewer appears');
    await browser.screenshot('2-convergence');
    await browser.evaluate("document.querySelector('.viewer').scrollIntoView()");
    await browser.until("document.querySelector('.pane canvas').width > 300", 'the first image is drawn');
    await browser.settle();
    const first = await browser.evaluate(pixels);
    check(new Set(first).size > 20, `the image has ${new Set(first).size} levels`);
    await browser.screenshot('3-slider');

    // The page's radiance is that of the files: its mean ratio agrees with the program's.
    const ratios = await browser.evaluate(`${viewer}.pictures.slice(1).map((p, i) =>
        mean(p) / mean(${viewer}.reference) / report.scenes[0].methods[i].runs[0].errors.mean_ratio)`);
    check(ratios.every(r => Math.abs(r - 1) < 1e-3), `decoded means over computed ones: ${ratios.map(r => r.toFixed(5))}`);

    const box = await browser.evaluate(`(() => { const b = document.querySelector('.pane canvas').getBoundingClientRect();
        return [b.left, b.top, b.width, b.height]; })()`);
    const at = (x, y) => [box[0] + x * box[2], box[1] + y * box[3]];

    await browser.drag(at(0.5, 0.95), at(0.2, 0.95));
    check(Math.abs(await browser.evaluate(`${viewer}.divider`) - 0.2) < 0.02, 'the divider follows the pointer');
    const slid = await browser.evaluate(pixels);
    check(differs(first, slid), 'moving the divider changes the picture');

    await browser.wheel(at(0.6, 0.5), -600);
    const zoom = await browser.evaluate(`${viewer}.zoom`);
    check(zoom > 2, `the wheel zooms: ${zoom}`);
    const zoomed = await browser.evaluate(pixels);
    check(differs(slid, zoomed), 'zooming changes the picture');
    await browser.screenshot('4-zoomed');
    const center = await browser.evaluate(`${viewer}.center`);
    await browser.evaluate(`${viewer}.insets.length = 0`);  // so that nothing but the image is under the pointer
    await browser.drag(at(0.7, 0.4), at(0.8, 0.6));
    const moved = await browser.evaluate(`${viewer}.center`);
    check(moved[0] < center[0] && moved[1] < center[1], 'dragging pans');
    await browser.evaluate(`${button('reset view')}.click()`);
    check(await browser.evaluate(`${viewer}.zoom`) === 1, 'the view can be reset');

    await browser.evaluate(`${button('add inset')}.click()`);
    await browser.settle();
    const inset = await browser.evaluate(`({...${viewer}.insets[0]})`);
    const imageWidth = await browser.evaluate(`${viewer}.width`);
    const scale = await browser.evaluate(`${viewer}.scale(document.querySelector('.pane canvas'))`);
    await browser.drag(at(0.52, 0.5), at(0.62, 0.5));
    const dragged = await browser.evaluate(`({...${viewer}.insets[0]})`);
    check(Math.abs(dragged.x - inset.x - 0.1 * box[2] / scale) < 0.02 * imageWidth, 'an inset can be dragged');
    const crops = await browser.evaluate("document.querySelector('.viewer').querySelectorAll('.insets canvas').length");
    check(crops === rows + 1, `a crop of each image: ${crops}`);

    const before = average(await browser.evaluate(pixels));
    await browser.evaluate(`(() => { const s = document.querySelector('.exposure'); s.value = Number(s.value) + 2;
        s.dispatchEvent(new Event('input')); })()`);
    await browser.settle();
    const brighter = average(await browser.evaluate(pixels));
    check(brighter > 1.1 * before, `exposure brightens: ${before.toFixed(0)} to ${brighter.toFixed(0)}`);
    await browser.screenshot('5-exposure');
    await browser.evaluate(`${button('reset view')}.click()`);
    await browser.settle();
    check(Math.abs(average(await browser.evaluate(pixels)) - before) < 0.02 * before, 'and can be taken back');

    let shown = await browser.evaluate(pixels);
    for (const [i, display] of ['relative squared error', 'signed difference', 'FLIP'].entries()) {
        await choose(browser, 'show', display);
        const now = await browser.evaluate(pixels);
        check(differs(shown, now), `${display} is drawn`);
        shown = now;
        await browser.screenshot(`6-${i + 1}-${display.replaceAll(' ', '-')}`);
    }
    await choose(browser, 'show', 'image');
    await choose(browser, 'tone', 'ACES');

    await browser.evaluate(`${button('side by side')}.click()`);
    await browser.settle();
    const panes = await browser.evaluate("document.querySelectorAll('.viewer')[0].querySelectorAll('.pane').length");
    check(panes === rows + 1, `side by side: ${panes} panes`);
    await browser.evaluate("document.querySelector('.viewer').scrollIntoView()");
    await browser.screenshot('7-side-by-side');
    await browser.evaluate(`${button('flip')}.click()`);
    await browser.settle();
    const reference = await browser.evaluate(`${viewer}.show(0)`).then(() => browser.settle()).then(() => browser.evaluate(pixels));
    await browser.evaluate("document.querySelector('.viewer').focus()");
    await browser.send('Input.dispatchKeyEvent', {type: 'keyDown', key: '2', text: '2'});
    await browser.settle();
    check(differs(reference, await browser.evaluate(pixels)), 'flipping by key changes the picture');
    await browser.send('Input.dispatchKeyEvent', {type: 'keyDown', key: ' ', text: ' '});
    await browser.settle();
    check(!differs(reference, await browser.evaluate(pixels)), 'and flips back');

    await browser.evaluate("document.querySelector('.insets').scrollIntoView()");
    await browser.screenshot('8-insets');
    await browser.evaluate(`(() => { const all = document.querySelectorAll('details'); if (all.length === 0) return;
        const last = all[Math.min(all.length, report.scenes[0].methods.length) - 1]; last.open = true; last.scrollIntoView(); })()`);
    await browser.screenshot('9-techniques');
    await browser.evaluate("document.querySelector('footer').scrollIntoView()");
    await browser.screenshot('10-footer');

    const outside = browser.requests.filter(u => !u.startsWith('data:') && !u.startsWith('file:') && !u.startsWith('blob:'));
    check(outside.length === 0, `no request leaves the page: ${outside}`);
    check(browser.complaints.length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);
}

if (screenshots) mkdirSync(screenshots, {recursive: true});
const browser = new Browser({flags: ['--disable-gpu'], screenshots});
try {
    await run(browser);
} catch (error) {
    console.log(`FAIL ${error.stack}`);
    ++failures;
} finally {
    browser.close();
}
process.exitCode = failures > 0 ? 1 : 0;
