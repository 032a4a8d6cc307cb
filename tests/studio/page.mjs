// What the tests of the page of `etendue studio` share: the program, a browser, keys and the pointer.
//
// The arguments of each test: the program, a scene, and optionally a folder for screenshots. Needs Node.js and Chromium;
// see browser.mjs.

import {spawn} from 'node:child_process';
import {mkdirSync, mkdtempSync, rmSync} from 'node:fs';
import {tmpdir} from 'node:os';
import {join} from 'node:path';

import {Browser} from '../support/browser.mjs';

export const [program, sceneFile, screenshots] = process.argv.slice(2);
if (!sceneFile) {
    console.error('arguments: the program, a scene, and optionally a folder for screenshots');
    process.exit(2);
}
/// The program's output folder.
export const folder = mkdtempSync(join(tmpdir(), 'etendue-studio-'));
export const openBrowser = () => new Browser({
    flags: ['--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist'], screenshots});

let failures = 0;
export function check(holds, what) {
    console.log(`${holds ? 'ok  ' : 'FAIL'} ${what}`);
    if (!holds) ++failures;
}

/// Runs the parts of a test, and ends with its exit code.
export async function runParts(...parts) {
    if (screenshots) mkdirSync(screenshots, {recursive: true});
    for (const part of parts)
        try {
            await part();
        } catch (error) {
            console.log(`FAIL ${error.stack}`);
            ++failures;
        }
    rmSync(folder, {recursive: true, force: true});
    process.exitCode = failures > 0 ? 1 : 0;
}

/// A running program.
export class Studio {
    static async start(scene, ...more) {
        const studio = new Studio();
        studio.process = spawn(program, ['studio', scene, '-o', folder, '--threads', '1', ...more]);
        studio.errors = '';
        studio.process.stderr.on('data', d => { studio.errors += d; });
        studio.ended = new Promise(fulfil => studio.process.on('exit', fulfil));
        studio.url = await new Promise((fulfil, reject) => {
            let text = '';
            studio.process.stdout.on('data', d => { text += d; if (text.includes('\n')) fulfil(text.trim()); });
            studio.process.on('exit', () => reject(new Error(`the program ended: ${studio.errors}`)));
        });
        return studio;
    }
    stop(signal = 'SIGINT') {
        this.process.kill(signal);
        return this.ended;
    }
}

const kCodes = {' ': 'Space', '[': 'BracketLeft', ']': 'BracketRight'};
export async function key(browser, name, times = 1, modifiers = 0) {
    for (let i = 0; i < times; ++i) {
        const text = name.length === 1 && modifiers !== 2 ? name : name === 'Enter' ? '\r' : undefined;
        const kVirtual = {Tab: 9, Enter: 13, ' ': 32};
        const event = {key: name, code: kCodes[name] ?? name, text, modifiers, windowsVirtualKeyCode: kVirtual[name]};
        await browser.send('Input.dispatchKeyEvent', {type: text ? 'keyDown' : 'rawKeyDown', ...event});
        await browser.send('Input.dispatchKeyEvent', {type: 'keyUp', ...event});
    }
}
/// Tab until the element is focused.
export async function tabTo(browser, selector) {
    for (let i = 0; i < 120; ++i) {
        if (await browser.evaluate(`document.activeElement.matches('${selector}')`)) return true;
        await key(browser, 'Tab');
    }
    return false;
}

export const box = (browser, selector) => browser.evaluate(`(() => { const b = document.querySelector('${selector}').getBoundingClientRect();
    return [b.left, b.top, b.width, b.height]; })()`);
export async function click(browser, x, y) {
    await browser.mouse('mousePressed', x, y);
    await browser.mouse('mouseReleased', x, y);
    await browser.settle();
}
/// What a canvas shows: one number for each pixel of a coarse grid.
export const pixels = (browser, id) => browser.evaluate(`(() => {
    const c = document.getElementById('${id}');
    const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});
    const context = copy.getContext('2d', {willReadFrequently: true});
    context.drawImage(c, 0, 0);
    const d = context.getImageData(0, 0, c.width, c.height).data, out = [];
    for (let y = 4; y < c.height; y += 12) for (let x = 4; x < c.width; x += 12) { const at = 4 * (y * c.width + x); out.push(d[at] + d[at + 1] + d[at + 2]); }
    return out;
})()`);
export const average = values => values.reduce((a, b) => a + b, 0) / values.length;
export const differs = (a, b) => a.length !== b.length || a.some((v, i) => v !== b[i]);

export async function checkNames(browser, what) {
    const nameless = await browser.evaluate(`[...document.querySelectorAll('button, input, select, canvas, svg, [role]')]
        .filter(e => e.getClientRects().length && !e.textContent.trim() && !e.getAttribute('aria-label') && !e.getAttribute('aria-labelledby')
            && !(e.labels && e.labels.length) && !e.title && e.getAttribute('role') !== 'alert' && e.getAttribute('role') !== 'status')
        .map(e => e.outerHTML.slice(0, 120))`);
    check(nameless.length === 0, `${what}: all controls have names ${nameless}`);
}

/// Presses arrows until the crosshair is at a point of the scene.
export async function crossTo(browser, point) {
    const [tx, ty] = await browser.evaluate(`studio.space().project(${JSON.stringify(point)})`);
    const [x, y] = await browser.evaluate('studio.space().cross');
    const go = async (distance, plus, minus) => {
        const large = Math.floor(Math.abs(distance) / 0.2), small = Math.round((Math.abs(distance) - 0.2 * large) / 0.02);
        await key(browser, distance > 0 ? plus : minus, large, 8);
        await key(browser, distance > 0 ? plus : minus, small);
    };
    await go(tx - x, 'ArrowRight', 'ArrowLeft');
    await go(ty - y, 'ArrowUp', 'ArrowDown');
}
export const paths = 'studio.editor().paths';
/// Waits for the edits of the paths.
export const idle = browser => browser.evaluate('studio.editor().queue');

/// Replaces the text of the focused field.
export async function type(browser, text) {
    await key(browser, 'a', 1, 2);
    for (const c of String(text)) await key(browser, c);
}
