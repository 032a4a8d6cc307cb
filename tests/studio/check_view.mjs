// What is shown of an image, and what is rendered, by `etendue studio` in a headless browser: tone operators, exposure and
// histogram, differences, the picture as a file; the worst pixels and their paths; a region; another camera and sensor.
//
//     node check_view.mjs etendue scene.xml [folder for screenshots]

import {writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, average, check, checkNames, differs, folder, openBrowser, pixels, runParts} from './page.mjs';

/// A closed room whose lamp shines through a glass ball, so that path tracing has fireflies; with two sensors.
const wall = transform => `<shape type="rectangle"><transform name="to_world">${transform}</transform></shape>`;
const sensor = (id, origin) => `<sensor type="perspective" id="${id}"><float name="fov" value="70"/>
<transform name="to_world"><lookat origin="${origin}" target="0,-0.2,0" up="0,1,0"/></transform><film type="hdrfilm">
<integer name="width" value="80"/><integer name="height" value="60"/></film></sensor>`;
const scene = `<scene version="3.0.0">${sensor('front', '0,0,0.95')}${sensor('side', '0.95,0,0.2')}
${wall('<rotate x="1" angle="-90"/><translate y="-1"/>')}${wall('<rotate x="1" angle="90"/><translate y="1"/>')}
${wall('<translate z="-1"/>')}${wall('<rotate y="1" angle="180"/><translate z="1"/>')}
${wall('<rotate y="1" angle="90"/><translate x="-1"/>')}${wall('<rotate y="1" angle="-90"/><translate x="1"/>')}
<shape type="sphere"><point name="center" x="0.2" y="-0.6" z="0"/><float name="radius" value="0.3"/><bsdf type="dielectric"/></shape>
<shape type="sphere"><point name="center" x="0" y="0.7" z="0"/><float name="radius" value="0.05"/><emitter type="area"><rgb name="radiance" value="60,55,50"/></emitter></shape>
</scene>`;

const file = join(folder, 'room.xml');
writeFileSync(file, scene);
const first = 'studio.runs.get(studio.shown[0].run)';
const choose = (id, value) => `(() => { const s = document.getElementById('${id}'); s.value = '${value}'; s.dispatchEvent(new Event('change')); })()`;
const press = id => `document.getElementById('${id}').click()`;

async function shownPart(browser) {
    await browser.until(`studio.shown[0].passes >= 8`, 'eight passes');
    await browser.evaluate(press('auto-exposure'));
    const stops = await browser.evaluate('studio.view.exposure');
    check(stops !== 0 && Number.isInteger(4 * stops), `the exposure is chosen by the image: ${stops} stops`);
    const text = await browser.evaluate("document.getElementById('histogram-text').textContent");
    check(text.includes('95 % below'), `the histogram has a text: ${text}`);
    check(await browser.evaluate(`(() => { const c = document.getElementById('histogram');
        return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.some(v => v > 0); })()`), 'the histogram is drawn');
    await browser.settle();
    const plain = await pixels(browser, 'view');
    await browser.evaluate(choose('tone', 1));
    await browser.settle();
    const aces = await pixels(browser, 'view');
    await browser.evaluate(choose('tone', 2));
    await browser.settle();
    const reinhard = await pixels(browser, 'view');
    check(differs(plain, aces) && differs(plain, reinhard) && differs(aces, reinhard), `tone operators differ: ${average(plain).toFixed(0)}, ${average(aces).toFixed(0)}, ${average(reinhard).toFixed(0)}`);
    await browser.evaluate(choose('tone', 1));
    await browser.screenshot('view-1-aces');
    const size = await browser.evaluate(`studio.view.png().then(async blob => { const image = await createImageBitmap(blob); return [image.width, image.height]; })`);
    check(size[0] === 80 && size[1] === 60, `the picture is saved in its own size: ${size}`);
    await browser.settle();
    check(await browser.evaluate('studio.view.canvas.width > 80'), 'the view has its size again');
}

async function worstPart(browser) {
    await browser.evaluate(press('find-worst'));
    await browser.until("document.querySelectorAll('#worst .replayed button').length === 20", 'the worst pixels');
    await browser.screenshot('view-2-worst');
    const text = await browser.evaluate("document.querySelector('#worst .replayed button').textContent");
    const [, x, y, pass] = text.match(/\((\d+), (\d+)\) pass (\d+)/).map(Number);
    const passes = await browser.evaluate('[...studio.runs.values()][0].passes');
    check(Number(text.match(/(\d+) %/)[1]) / 100 * passes > 20, `one pass made more of the worst pixel than 20 others: ${text} of ${passes}`);
    await browser.evaluate("document.querySelector('#worst .replayed button').click()");
    await browser.until('studio.inspector()?.paths.length > 0 && studio.inspector().chosen === 0', 'its paths are traced again', 150);
    const found = await browser.evaluate(`(() => { const i = studio.inspector(); return {pixel: i.pixel, message: i.message.textContent, sum: i.sum, first: i.paths[0].value}; })()`);
    check(found.pixel.x === x && found.pixel.y === y && found.message.includes(`pass ${pass}`), `they are of its pixel and pass: ${found.message}`);
    const luminance = v => 0.2126 * v[0] + 0.7152 * v[1] + 0.0722 * v[2];
    check(luminance(found.first) > 0.5 * luminance(found.sum), 'one path is most of what the pass made');
    check(await browser.evaluate('studio.space().lines.replayed.length > 0'), 'the path is drawn');
    await browser.screenshot('view-3-firefly');
    await browser.evaluate("document.getElementById('tab-image').click()");
    await browser.until("document.getElementById('trace-brightest')", 'the pixel names its brightest pass');
}

async function renderedPart(browser) {
    // A region.
    await browser.evaluate('(() => { studio.view.corner = [10, 20]; studio.view.moveCursor(29, 34); })()');
    await browser.until("!document.getElementById('render-region').disabled", 'a region can be rendered');
    await browser.evaluate(press('render-region'));
    await browser.until(`studio.state().scene?.width === 20 && studio.state().scene.height === 15 && studio.shown[0].run === 2 && studio.shown[0].passes > 1`, 'the region is rendered', 150);
    const crop = await browser.evaluate('studio.state().scene.crop');
    check(crop[0] === 10 && crop[1] === 20, `at its place: ${crop}`);
    check(await browser.evaluate(`${first}.integrator.startsWith('path')`), 'by the same method');
    await browser.screenshot('view-4-region');
    await browser.evaluate(press('render-whole'));
    await browser.until('studio.state().scene?.width === 80 && studio.shown[0].run === 3 && studio.shown[0].passes > 4', 'the whole image again', 150);
    check(await browser.evaluate("document.getElementById('render-whole').hidden"), 'which needs no button then');
    await browser.settle();
    const before = await pixels(browser, 'view');

    // Another camera, from the view in three dimensions.
    await browser.evaluate("document.getElementById('tab-paths').click()");
    await browser.until('studio.space()?.shapes.length > 0', 'the scene in three dimensions', 150);
    await browser.evaluate('studio.space().orbit(0.5, -0.2)');
    await browser.settle();
    await browser.screenshot('view-5-orbit');
    await browser.evaluate(`(() => { const {server} = studio, post = server.post; server.post = function(path, body) { if (body.camera) window.sentCamera = body.camera; return post.call(server, path, body); }; })()`);
    await browser.evaluate(press('render-view'));
    await browser.until('studio.state().scene?.has_own_camera && studio.shown[0].run === 4 && studio.shown[0].passes > 4', 'the view is rendered', 150);
    await browser.settle();
    check(differs(before, await pixels(browser, 'view')), 'its image is another one');
    await browser.screenshot('view-6-camera');
    const eye = await browser.evaluate('[studio.state().scene.eye, studio.space().eye()]');
    check(Math.hypot(...eye[0].map((v, i) => v - eye[1][i])) < 1e-3, `the camera is where the view was: ${eye[0].map(v => v.toFixed(3))}`);
    const [distance, radius] = await browser.evaluate('[Math.hypot(...sentCamera.target.map((v, i) => v - sentCamera.eye[i])), studio.space().radius]');
    check(Math.abs(distance - radius) < 1e-3 * radius, `its target is as far as the scene is large: ${distance}`);
    await browser.evaluate('delete studio.server.post');
    await browser.evaluate(press('file-camera'));
    await browser.until('studio.state().scene && !studio.state().scene.has_own_camera && studio.shown[0].run === 5 && studio.shown[0].passes > 1', 'the camera of the file again', 150);

    // The second sensor.
    await browser.evaluate(choose('sensor', 1));
    await browser.until('studio.state().scene?.sensor === 1 && studio.shown[0].run === 6 && studio.shown[0].passes > 1', 'the other sensor', 150);

    // Differences of two runs.
    await browser.evaluate(choose('sensor', 0));
    await browser.until('studio.state().scene?.sensor === 0 && studio.shown[0].run === 7 && studio.shown[0].passes > 4', 'the first sensor', 150);
    await browser.evaluate(choose('against', 3));
    await browser.until('studio.view.pictures[1]', 'a second picture');
    const seen = [];
    for (const mode of [2, 3, 4]) {
        await browser.evaluate(choose('mode', mode));
        await browser.settle();
        seen.push(await pixels(browser, 'view'));
    }
    check(differs(seen[0], seen[1]) && differs(seen[1], seen[2]), 'relative, signed and squared differences look different');
    await browser.screenshot('view-7-squared');

    // A pixel of the second picture that is not a number.
    for (const mode of [0, 2, 3, 4]) {
        const color = await browser.evaluate(`(() => {
            const {view} = studio, picture = (...halves) => ({channels: 1, scale: 0, columns: 2, rows: 1, halves: new Uint16Array(halves)});
            view.show(0, picture(0x3c00, 0x3c00));
            view.show(1, picture(0x3c00, 0x7e00));
            [view.mode, view.wipe] = [${mode}, 1];
            view.draw(false);
            const out = new Uint8Array(4), {gl, canvas} = view;
            gl.readPixels(Math.round(canvas.width / 2 + view.scale() * view.width / 4), Math.round(canvas.height / 2), 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, out);
            return [...out];
        })()`);
        const isMarked = color[0] === 255 && color[1] === 0 && color[2] === 255;
        check(isMarked === (mode > 0), `in mode ${mode} what is not a number has the colour ${color}`);
    }
}

/// A part of the image that the command line gives; two runs, of which the earlier one has the worst pixels.
async function partPart(browser) {
    await browser.until('studio.state()?.scene?.width === 20 && studio.shown[0].passes >= 8', 'a part of the image');
    await browser.evaluate(press('find-worst'));
    await browser.until("document.querySelectorAll('#worst .replayed button').length === 20", 'its worst pixels');
    await browser.evaluate("studio.server.post('/v1/run', {action: 'start', integrator: 'bdpt'})");
    await browser.until("studio.runs.get(2)?.passes > 1", 'another run');
    await browser.evaluate(`document.querySelector('[aria-label="Show run 2"]').click()`);
    await browser.until('studio.shown[0].run === 2 && studio.shown[0].passes > 0', 'it is shown');
    await browser.evaluate("document.querySelector('#worst .replayed button').click()");
    await browser.until('studio.inspector()?.paths.length > 0 && studio.inspector().chosen === 0', 'the pixel is traced again', 150);
    const runs = await browser.evaluate('[studio.inspector().pixel.run, studio.inspector().of, studio.shown[0].run]');
    check(runs.every(r => r === 1), `in its own run, which is shown: ${runs}`);

    // What is superseded does not go on. Its pixel would be so bright that splats were asked for.
    const late = await browser.evaluate(`(async () => {
        const i = studio.inspector(), {server} = studio, post = server.post;
        let requests = 0;
        server.post = function(...a) { ++requests; return post.apply(server, a); };
        await Promise.all([i.replayPass(0, 1e9), i.replay(1)]);
        delete server.post;
        return {requests, splats: i.splats.checked, chosen: i.chosen};
    })()`);
    check(late.requests === 2 && !late.splats && late.chosen === -1, `a later request ends an earlier one: ${JSON.stringify(late)}`);

    await browser.evaluate("document.getElementById('tab-image').click()");
    await browser.evaluate(press('render-whole'));
    await browser.until('studio.state().scene?.width === 80 && studio.shown[0].run === 3 && studio.shown[0].passes > 1', 'the whole image', 150);
}

await runParts(async () => {
    const studio = await Studio.start(file, '-i', 'path', '--crop', '30,20,20,15');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await partPart(browser);
    } finally {
        browser.close();
        await studio.stop();
    }
}, async () => {
    const studio = await Studio.start(file, '-i', 'path');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await shownPart(browser);
        await worstPart(browser);
        await renderedPart(browser);
        await checkNames(browser, 'the image');
        // Images of a run of another size are refused.
        const complaints = browser.complaints.filter(c => !c.includes('409'));
        check(complaints.length === 0, `the console is quiet: ${complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop();
    }
});
