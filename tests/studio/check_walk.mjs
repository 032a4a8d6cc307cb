// Walking through a scene in `etendue studio`, and the firefly of a method that shares light paths, in a headless browser.
//
//     node check_walk.mjs etendue scene.xml [folder for screenshots]

import {writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, box, check, checkNames, differs, folder, key, openBrowser, pixels, runParts} from './page.mjs';

/// Two rooms with a door between them, z upward; the camera is in the first one.
const wall = (size, to) => `<shape type="cube"><transform name="to_world"><scale value="${size}"/><translate value="${to}"/></transform></shape>`;
const scene = `<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="60"/>
<transform name="to_world"><lookat origin="0,-1.5,0" target="0,0,0" up="0,0,1"/></transform><film type="hdrfilm">
<integer name="width" value="80"/><integer name="height" value="60"/></film></sensor>
${wall('2,4.1,0.1', '0,2,-1')}${wall('2,4.1,0.1', '0,2,1')}${wall('0.1,4.1,1', '-2,2,0')}${wall('0.1,4.1,1', '2,2,0')}
${wall('2,0.1,1', '0,-2,0')}${wall('2,0.1,1', '0,6,0')}${wall('0.8,0.05,1', '-1.2,2,0')}${wall('0.8,0.05,1', '1.2,2,0')}
<shape type="sphere"><point name="center" x="0.8" y="0.5" z="-0.6"/><float name="radius" value="0.25"/><bsdf type="dielectric"/></shape>
<shape type="sphere"><point name="center" x="0" y="0.5" z="0.7"/><float name="radius" value="0.06"/><emitter type="area"><rgb name="radiance" value="60,55,50"/></emitter></shape>
<shape type="sphere"><point name="center" x="0.5" y="4" z="0.7"/><float name="radius" value="0.06"/><emitter type="area"><rgb name="radiance" value="60,20,10"/></emitter></shape>
</scene>`;
const file = join(folder, 'rooms.xml');
writeFileSync(file, scene);
const press = id => `document.getElementById('${id}').click()`;
const eye = browser => browser.evaluate('studio.space().eye()');
const distance = (a, b) => Math.hypot(...a.map((v, i) => v - b[i]));

/// Holds a key until a condition holds.
async function hold(browser, code, condition, what) {
    const event = {key: code.at(-1).toLowerCase(), code};
    await browser.send('Input.dispatchKeyEvent', {type: 'rawKeyDown', ...event});
    await browser.until(condition, what);
    await browser.send('Input.dispatchKeyEvent', {type: 'keyUp', ...event});
}

async function walkPart(browser) {
    await browser.until('studio.shown[0].passes >= 2', 'a rendering');
    await browser.evaluate(press('tab-paths'));
    await browser.until('studio.space()?.shapes.length > 0', 'the scene');
    const up = await browser.evaluate('studio.space().frame().up');
    check(distance(up, [0, 0, 1]) < 1e-6, `the axis that is up for the camera is up: ${up}`);
    const start = await eye(browser);
    check(distance(start, [0, -1.5, 0]) < 1e-3, `the view begins at the camera: ${start}`);
    await browser.evaluate(press('walk'));
    check(await browser.evaluate("document.activeElement.id === 'space' && document.getElementById('space-label').textContent.includes('scene units a second')"), 'walking begins, and says how fast');
    check(await browser.evaluate("document.getElementById('spoken').textContent.includes('scene units a second')"), 'to screen readers, too');
    await browser.screenshot('walk-1-start');
    // Shift counts as well where it is pressed after the other key.
    const send = (type, event) => browser.send('Input.dispatchKeyEvent', {type, ...event});
    const shift = {key: 'Shift', code: 'ShiftLeft'}, back = {key: 's', code: 'KeyS'};
    await send('rawKeyDown', back);
    await send('rawKeyDown', {...shift, modifiers: 8});
    check(await browser.evaluate('studio.space().runs && studio.space().pressed.size === 1'), 'Shift makes the walk faster while it lasts');
    await send('keyUp', shift);
    check(await browser.evaluate('!studio.space().runs'), 'and slower when it is released');
    await send('keyUp', back);
    await browser.evaluate('studio.space().lookAsCamera()');
    await hold(browser, 'KeyW', 'studio.space().eye()[1] > 3', 'through the door');
    const there = await eye(browser);
    check(Math.abs(there[0]) < 1e-3 && Math.abs(there[2]) < 1e-3, `straight on: ${there}`);
    await browser.settle();
    await browser.screenshot('walk-2-second-room');
    check(distance(there, await eye(browser)) < 1e-9, 'no key, no motion');

    // Looking around turns about the eye.
    const [left, top, width, height] = await box(browser, '#space');
    const before = await pixels(browser, 'space');
    await browser.drag([left + width / 2, top + height / 2], [left + width / 2 + 300, top + height / 2 + 20]);
    check(distance(there, await eye(browser)) < 1e-6, 'a drag turns about the eye');
    check(differs(before, await pixels(browser, 'space')), 'and shows another view');
    await hold(browser, 'KeyE', 'studio.space().eye()[2] > 0.3', 'upward');
    await hold(browser, 'KeyF', 'studio.space().eye()[2] < 0.2', 'and down');
    const here = await eye(browser);
    await hold(browser, 'KeyD', `Math.hypot(...studio.space().eye().map((v, i) => v - ${JSON.stringify(here)}[i])) > 0.2`, 'to the side');
    const [side, right] = [await eye(browser), await browser.evaluate('studio.space().frame().right')];
    check(side.every((v, i) => Math.abs((v - here[i]) - right[i] * distance(side, here)) < 1e-3), 'which is that of the view');
    const speed = await browser.evaluate('studio.space().speed');
    await browser.wheel([left + width / 2, top + height / 2], -200);
    check(await browser.evaluate('studio.space().speed') > 1.2 * speed, 'the wheel changes the speed');
    check(distance(side, await eye(browser)) < 1e-6, 'and nothing else');

    // What is seen is rendered.
    await browser.evaluate(press('render-view'));
    await browser.until('studio.state().scene?.has_own_camera && studio.shown[0].run === 2 && studio.shown[0].passes > 4', 'the view is rendered', 150);
    check(distance(side, await browser.evaluate('studio.state().scene.eye')) < 1e-3, 'from where the walk ended');
    check(await browser.evaluate('studio.state().scene.up[2] > 0'), 'upright');
    await browser.evaluate(press('auto-exposure'));
    await browser.screenshot('walk-3-rendered');

    // Without walking, zooming in goes on beyond the target.
    await browser.evaluate(press('tab-paths'));
    await browser.evaluate(press('walk'));
    await browser.evaluate('studio.space().lookFromOutside()');
    await browser.evaluate("document.getElementById('space').focus()");
    const far = await eye(browser), radius = await browser.evaluate('studio.space().radius');
    await key(browser, 'q', 120);
    check(distance(far, await eye(browser)) > 3 * radius, `the view goes through the scene: ${distance(far, await eye(browser)) / radius} radii`);
    await checkNames(browser, 'walking');
    await browser.evaluate(press('tab-image'));
    await browser.evaluate(press('file-camera'));
    await browser.until('!studio.state().scene?.has_own_camera && studio.shown[0].run === 3 && studio.shown[0].passes > 4', 'the camera of the file', 150);
}

/// A click with Ctrl on a firefly, of a method that shares light paths.
async function fireflyPart(browser) {
    await browser.evaluate("studio.server.post('/v1/run', {action: 'start', integrator: 'upg', spp: 24})");
    await browser.until("studio.runs.get(4)?.state === 'finished'", 'another method', 150);
    await browser.evaluate(`document.querySelector('[aria-label="Show run 4"]').click()`);
    await browser.until('studio.shown[0].run === 4 && studio.shown[0].passes === 24', 'it is shown');
    const worst = (await browser.evaluate("studio.server.get('/v1/worst?run=4&count=20')")).pixels
        .find(w => w.pass < 23);
    await browser.evaluate('studio.space().lookAsCamera()');
    const [left, top] = await box(browser, '#view');
    const at = await browser.evaluate(`(() => { const v = studio.view, s = v.scale(), o = v.origin(); return [(o[0] + (${worst.x} + 0.5) * s) / devicePixelRatio, (o[1] + (${worst.y} + 0.5) * s) / devicePixelRatio]; })()`);
    await browser.mouse('mousePressed', left + at[0], top + at[1], {modifiers: 2});
    await browser.mouse('mouseReleased', left + at[0], top + at[1], {modifiers: 2});
    await browser.until('studio.inspector()?.paths.length > 0 && studio.inspector().chosen === 0', 'its paths are traced again', 60);
    const found = await browser.evaluate('(() => { const i = studio.inspector(); return {pixel: i.pixel, message: i.message.textContent, sum: i.paths.reduce((s, p) => s.map((v, c) => v + p.value[c]), [0, 0, 0])}; })()');
    check(found.pixel.x === worst.x && found.pixel.y === worst.y && found.message.includes(`pass ${worst.pass};`), `of the pixel and of its pass: ${found.message}`);
    const luminance = 0.2126 * found.sum[0] + 0.7152 * found.sum[1] + 0.0722 * found.sum[2];
    check(Math.abs(luminance - worst.value) < 1e-3 * worst.value, `they are what made it bright: ${luminance} of ${worst.value}`);
    await browser.screenshot('walk-4-firefly');
}

/// Values are copied, channels are chosen.
async function valuesPart(browser) {
    await browser.evaluate(press('tab-image'));
    await browser.evaluate('navigator.clipboard.writeText = async text => { window.copied = text; }');
    await browser.evaluate('studio.view.moveCursor(20, 30)');
    await browser.until("document.querySelector('#pixel').textContent.includes('(20, 30)') && document.getElementById('copy-values')", 'its values');
    await browser.evaluate("document.getElementById('view').focus()");
    await key(browser, 'c');
    await browser.until('window.copied', 'they are copied');
    const [copied, mean] = await browser.evaluate("studio.server.get('/v1/pixel?run=4&x=20&y=30').then(p => [window.copied, p.mean])");
    const numbers = copied.split(' ').map(Number);
    check(numbers.length === 5 && numbers[0] === 20 && numbers[1] === 30 && mean.every((v, i) => Math.abs(v - numbers[2 + i]) <= 1e-6 * v), `the place and the mean: ${copied}`);
    const seen = [];
    for (const channel of [0, 1, 2, 3, 4]) {
        await browser.evaluate(`(() => { const s = document.getElementById('channel'); s.value = '${channel}'; s.dispatchEvent(new Event('change')); })()`);
        await browser.settle();
        const color = await browser.evaluate(`(() => { studio.view.draw(false); const {gl, canvas} = studio.view, out = new Uint8Array(4);
            gl.readPixels(canvas.width >> 1, canvas.height >> 1, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out); return [...out]; })()`);
        if (channel > 0) check(color[0] === color[1] && color[1] === color[2], `channel ${channel} is grey: ${color}`);
        seen.push(await pixels(browser, 'view'));
        if (channel === 1) await browser.screenshot('walk-5-red');
    }
    check(seen.every((a, i) => seen.every((b, j) => i === j || differs(a, b))), 'all channels look different');
}

await runParts(async () => {
    const studio = await Studio.start(file, '-i', 'path');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await walkPart(browser);
        await fireflyPart(browser);
        await valuesPart(browser);
        check(browser.complaints.length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop();
    }
});
