// Uses `etendue studio` in a headless browser: pixels appear and change with exposure, zoom and wipe; runs are started,
// stopped and continued, kept and opened again; rectangles and differences are measured; a path by way of a mirror is drawn by keys alone, and
// another by the pointer alone; the paths of a pixel are traced again; two pages edit the same paths; the program is killed.
// Controls have names, the console is quiet.
//
//     node check_studio.mjs etendue scene.xml [folder for screenshots]

import {existsSync, readFileSync, writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, average, box, check, checkNames, click, crossTo, differs, folder, idle, key, openBrowser, paths, pixels, runParts, sceneFile, tabTo} from './page.mjs';

/// A lamp above a floor, and a mirror on the left.
const rectangle = (id, transform, inside) =>
    `<shape type="rectangle" id="${id}"><transform name="to_world">${transform}</transform>${inside}</shape>`;
const mirrorScene = `<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="60"/>
<transform name="to_world"><lookat origin="0,0,3" target="0,-0.3,0" up="0,1,0"/></transform><film type="hdrfilm">
<integer name="width" value="64"/><integer name="height" value="48"/></film></sensor>
${rectangle('floor', '<rotate x="1" angle="-90"/><translate y="-1"/>', '')}
${rectangle('lamp', '<scale value="0.3"/><rotate x="1" angle="90"/><translate y="1"/>', '<emitter type="area"/>')}
${rectangle('mirror', '<rotate y="1" angle="90"/><translate x="-1"/>', '<bsdf type="conductor"/>')}</scene>`;

const first = 'studio.runs.get(studio.shown[0].run)';

async function imagePart() {
    const studio = await Studio.start(sceneFile, '-i', 'path', '--resolution', '160x120');
    const browser = openBrowser();
    try {
        const begin = Date.now();
        await browser.open(studio.url);
        const loaded = Date.now();
        await browser.until('studio.view.pictures[0]', 'the first pixels');
        console.log(`     first pixels ${Date.now() - loaded} ms after load, ${Date.now() - begin} ms after the address`);
        await browser.until('studio.shown[0].passes >= 4', 'four passes');
        await browser.settle();
        const one = await pixels(browser, 'view');
        check(new Set(one).size > 20, `the image has ${new Set(one).size} levels`);
        await browser.screenshot('1-image');
        check((await browser.evaluate('document.querySelector("#label").textContent')).includes('spp'), 'its passes are stated');

        // By keys: focus the image by Tab, then exposure, zoom, pixel, stop, continue.
        check(await tabTo(browser, '#view'), 'the image can be reached by Tab');
        await key(browser, '+', 4);
        await browser.settle();
        const brighter = await pixels(browser, 'view');
        check(average(brighter) > 1.2 * average(one), `+ brightens: ${average(one).toFixed(0)} to ${average(brighter).toFixed(0)}`);
        await key(browser, '-', 4);
        await key(browser, 'z', 5);
        check(await browser.evaluate('studio.view.zoom > 5'), 'Z zooms');
        await browser.screenshot('2-zoomed');
        await key(browser, '0');
        const cursor = await browser.evaluate('studio.view.cursor');
        await key(browser, 'ArrowRight', 3);
        await key(browser, 'ArrowDown', 1, 8);
        const moved = await browser.evaluate('studio.view.cursor');
        check(moved[0] === cursor[0] + 3 && moved[1] === cursor[1] + 10, `arrows move the cursor: ${moved}`);
        await browser.until(`document.querySelector('#pixel').textContent.includes('(${moved[0]}, ${moved[1]})') && document.querySelector('#pixel table')?.textContent.includes('±')`,
            'a pixel with its interval');
        const text = await browser.evaluate("document.querySelector('#pixel').textContent");
        check(text.includes(`(${moved[0]}, ${moved[1]})`) && text.includes('sobol'), `pixel values: ${text.slice(0, 80)}`);
        const value = await browser.evaluate(`studio.server.get('/v1/pixel?run=1&x=${moved[0]}&y=${moved[1]}')`);
        check(value.mean.every(v => v >= 0) && value.half.every(v => v >= 0), 'the server states means and intervals');
        await key(browser, ' ');
        await browser.until(`${first}.state === 'stopped'`, 'space stops');
        const passes = await browser.evaluate(`${first}.passes`);
        await browser.until(`studio.shown[0].passes === ${passes}`, 'the last pass is shown');
        await key(browser, ' ');
        await browser.until(`${first}.state === 'rendering' && ${first}.passes > ${passes}`, 'space continues');
        await browser.until("document.querySelector('#plot svg')", 'the convergence plot');
        check((await browser.evaluate("document.querySelector('#plot svg').getAttribute('aria-label')")).includes('run 1'), 'the plot has a text');

        // By the pointer: another method from the tables, shown beside the first, wiped.
        await browser.evaluate(`(() => { const s = document.getElementById('method'); s.value = 'bdpt'; s.dispatchEvent(new Event('change'));
            document.getElementById('techniques').value = 4; document.getElementById('parameter-max_depth').value = 5; })()`);
        const [bx, by, bw, bh] = await browser.evaluate(`(() => { const b = document.querySelector('#run-form button[type=submit]'); b.scrollIntoView();
            const r = b.getBoundingClientRect(); return [r.left, r.top, r.width, r.height]; })()`);
        await click(browser, bx + bw / 2, by + bh / 2);
        await browser.until('studio.runs.size === 2 && studio.shown[0].run === 2 && studio.shown[0].passes > 1', 'a second run is shown');
        check((await browser.evaluate('studio.runs.get(2).integrator')).includes('bdpt:max_depth=5'), 'with its parameter');
        await browser.evaluate(`(() => { const s = document.getElementById('against'); s.value = '1'; s.dispatchEvent(new Event('change')); })()`);
        await browser.until('studio.view.pictures[1]', 'the first run beside it');
        await browser.settle();
        const before = await pixels(browser, 'view');
        const [x, y, w, h] = await box(browser, '#view');
        const scale = await browser.evaluate('studio.view.scale() * studio.view.width / devicePixelRatio');
        await browser.drag([x + w / 2, y + h / 2], [x + w / 2 - 0.3 * scale, y + h / 2]);
        check(Math.abs(await browser.evaluate('studio.view.wipe') - 0.2) < 0.02, 'the wipe follows the pointer');
        await browser.screenshot('3-wipe');
        await browser.evaluate(`(() => { const s = document.getElementById('mode'); s.value = '2'; s.dispatchEvent(new Event('change')); })()`);
        await browser.settle();
        check(differs(before, await pixels(browser, 'view')), 'the difference is drawn');
        await browser.screenshot('4-difference');
        await browser.evaluate(`(() => { const s = document.getElementById('mode'); s.value = '0'; s.dispatchEvent(new Event('change'));
            const a = document.getElementById('against'); a.value = '0'; a.dispatchEvent(new Event('change')); })()`);
        for (const view of ['error', 'albedo', 'normal']) {
            await browser.evaluate(`(() => { const s = document.getElementById('view-choice'); s.value = '${view}'; s.dispatchEvent(new Event('change')); })()`);
            await browser.until(`studio.shown[0].view === '${view}' && studio.shown[0].passes > 0`, view);
            await browser.settle();
            check(new Set(await pixels(browser, 'view')).size > 3, `${view} is drawn`);
        }
        await browser.until("document.getElementById('view-choice').dataset.key.includes('length:')", 'technique images are offered');
        const techniques = await browser.evaluate("[...document.getElementById('view-choice').options].map(o => o.value).filter(v => v.includes('connect'))");
        check(techniques.length > 1, `techniques have names: ${techniques.slice(0, 2)}`);
        for (const view of ['length:2', ...techniques.slice(0, 2)]) {
            await browser.evaluate(`(() => { const s = document.getElementById('view-choice'); s.value = '${view}'; s.dispatchEvent(new Event('change')); })()`);
            await browser.until(`studio.shown[0].view === '${view}' && studio.shown[0].passes > 0`, view);
        }
        await browser.screenshot('5-technique');
        check((await browser.evaluate("document.getElementById('label').textContent")).includes('connect'), 'the label names the technique');

        // Another run has no technique images; until its image has come, the label says whose picture is drawn.
        await browser.evaluate("studio.server.held = studio.server.image; studio.server.image = () => new Promise(() => {})");
        await browser.evaluate("[...document.querySelectorAll('#run-list button')].find(b => b.getAttribute('aria-label') === 'Show run 1').click()");
        const waiting = await browser.evaluate("document.getElementById('label').textContent");
        check(waiting.startsWith('run 2') && waiting.includes('run 1') && waiting.includes('awaited'), `the label while the image is awaited: ${waiting}`);
        check(await browser.evaluate("studio.shown[0].view === 'image' && document.getElementById('view-choice').value === 'image' && !document.getElementById('view-choice').dataset.key.includes('technique:')"),
            'views that the run does not have are not offered');
        await browser.evaluate("studio.server.image = studio.server.held");
        await browser.evaluate("[...document.querySelectorAll('#run-list button')].find(b => b.getAttribute('aria-label') === 'Show run 2').click()");
        await browser.until("studio.shown[0].passes > 0 && document.getElementById('label').textContent.startsWith('run 2, ')", 'the second run again');

        // Files are replaced only if asked for.
        const mine = join(folder, 'mine.pfm');
        writeFileSync(mine, 'mine');
        await browser.evaluate("window.prompt = () => 'mine.pfm'; window.confirm = text => { window.asked = text; return window.answer; }; window.answer = false");
        const saves = () => browser.evaluate("[...document.querySelectorAll('#run-list button')].find(b => b.getAttribute('aria-label') === 'Save run 1').click()");
        await saves();
        await browser.until("window.asked?.includes('mine.pfm exists already')", 'a question');
        await browser.until("document.getElementById('banner-text').textContent.includes('exists already')", 'the refusal');
        check(readFileSync(mine, 'latin1') === 'mine', 'the file is not replaced without a yes');
        await browser.evaluate('window.answer = true');
        await saves();
        await browser.until("/mine.pfm: [0-9]+ spp saved/.test(document.getElementById('banner-text').textContent + document.getElementById('spoken').textContent)", 'the answer');
        check(readFileSync(mine, 'latin1').startsWith('PF'), 'and is with one');
        await browser.evaluate("document.getElementById('banner-action').click()");
        await checkNames(browser, 'image');
        const bad = await browser.evaluate(`studio.server.post('/v1/run', {action: 'start', integrator: 'path:max_depth=-9'}).then(() => '', e => e.status + ' ' + e.message)`);
        check(bad.startsWith('422') && bad.includes('max_depth'), `a bad parameter is refused: ${bad}`);
        check(browser.complaints.filter(c => !c.includes('422') && !c.includes('409')).length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);
        check(browser.requests.every(u => u.startsWith(studio.url.split('/#')[0]) || u.startsWith('blob:')), 'no request leaves the page');

        // A rectangle by keys and by the pointer; how far two runs are apart.
        await browser.evaluate(`(() => { const s = document.getElementById('view-choice'); s.value = 'image'; s.dispatchEvent(new Event('change')); })()`);
        await tabTo(browser, '#view');
        await key(browser, 'r');
        await key(browser, 'ArrowRight', 9);
        await key(browser, 'ArrowDown', 4);
        await browser.until("document.querySelector('#pixel').textContent.includes('10 × 5 pixels') && document.querySelector('#pixel table')?.textContent.includes('variance')", 'a rectangle by keys');
        await key(browser, 'Escape');
        check(await browser.evaluate('studio.view.corner === null'), 'Escape ends it');
        // The view may have another size now, since other tools are shown.
        const [left, top, width, height] = await box(browser, '#view');
        const drawn = await browser.evaluate('studio.view.scale() * studio.view.width / devicePixelRatio');
        const at = (u, v) => [left + width / 2 + (u - 0.5) * drawn, top + height / 2 + (v - 0.5) * drawn * 0.75];
        const corners = [at(0.3, 0.3), at(0.6, 0.7)];
        await browser.mouse('mousePressed', ...corners[0], {modifiers: 8});
        for (const f of [0, 0.5, 1]) await browser.mouse('mouseMoved', corners[0][0] + f * (corners[1][0] - corners[0][0]), corners[0][1] + f * (corners[1][1] - corners[0][1]) + 4, {modifiers: 8});
        await browser.mouse('mouseReleased', ...corners[1], {modifiers: 8});
        const selected = await browser.evaluate('studio.view.selected()');
        check(Math.abs(selected.w - 48) < 4 && Math.abs(selected.h - 48) < 5, `a rectangle by the pointer: ${JSON.stringify(selected)}`);
        await browser.until(`document.querySelector('#pixel').textContent.includes('${selected.w} × ${selected.h} pixels')`, 'its values');
        await browser.evaluate(`(() => { const s = document.getElementById('against'); s.value = '1'; s.dispatchEvent(new Event('change')); })()`);
        await browser.until('studio.view.pictures[1]', 'the other run');
        await browser.evaluate("[...document.querySelectorAll('#view-tools button')].find(b => b.textContent === 'Measure').click()");
        await browser.until("/relMSE [0-9].*LIP 0\\.[0-9]+.*against run 1/.test(document.getElementById('view-tools').textContent)", 'the difference');
        await browser.screenshot('5b-rectangle');
        await checkNames(browser, 'rectangle');

        // Killed: the picture stays, and the page says so.
        await studio.stop('SIGKILL');
        await browser.until("document.getElementById('banner-text').textContent.includes('does not answer since')", 'the banner');
        check(await browser.evaluate('studio.view.pictures[0] !== undefined'), 'the picture is kept');
        await browser.screenshot('6-gone');
    } finally {
        browser.close();
        await studio.stop('SIGKILL');
    }
}

/// A run that Ctrl-C has kept is opened and goes on.
async function keptPart() {
    const more = ['--resolution', '64x48', '--runs', join(folder, 'runs')];
    const first = await Studio.start(sceneFile, '-i', 'bdpt', ...more);
    try {
        const [origin, token] = first.url.split('/#token='), headers = {Authorization: `Bearer ${token}`};
        while (!((await (await fetch(`${origin}/v1/state`, {headers})).json()).runs[0]?.passes > 1)) await new Promise(r => setTimeout(r, 50));
        check(await first.stop() === 0 && existsSync(join(folder, 'runs', 'cornell-bdpt-1.etd')), 'Ctrl-C keeps the run');
    } finally {
        await first.stop('SIGKILL');
    }
    const studio = await Studio.start(sceneFile, '--idle', ...more);
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await browser.until("document.querySelector('#kept-list summary')?.textContent === 'Kept runs: 1'", 'it is listed');
        await browser.evaluate("document.querySelector('#kept-list details').open = true");
        await checkNames(browser, 'kept runs');
        await browser.screenshot('5c-kept');
        await browser.evaluate("document.querySelector('#kept-list .run button').click()");
        await browser.until('studio.shown[0].run === 1 && studio.shown[0].passes > 1', 'its image is shown');
        const passes = await browser.evaluate('studio.shown[0].passes');
        check(await browser.evaluate("document.querySelector('#run-list .figures').textContent.includes('kept in cornell-bdpt-1.etd')"), 'with the name of its file');
        await browser.evaluate("[...document.querySelectorAll('#run-list button')].find(b => b.textContent === 'Continue').click()");
        await browser.until(`studio.shown[0].passes > ${passes}`, 'and it goes on');
        check(browser.complaints.length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop('SIGKILL');
    }
}

/// A page of another origin reads nothing, though it has the token.
async function foreignPagePart() {
    const studio = await Studio.start(sceneFile, '-i', 'bdpt', '--resolution', '64x48');
    const browser = openBrowser();
    try {
        const token = studio.url.split('token=')[1], origin = studio.url.split('/#')[0];
        await browser.open('data:text/html,<p>foreign</p>');
        const read = await browser.evaluate(`Promise.all([
            fetch('${origin}/v1/state', {headers: {Authorization: 'Bearer ${token}'}}), fetch('${origin}/v1/state', {mode: 'no-cors'}), fetch('${origin}/')]
            .map(p => p.then(r => r.text()).catch(e => 'refused')))`);
        check(read.every(text => text === 'refused' || text === ''), `a foreign page reads nothing: ${read.map(t => t.slice(0, 40))}`);
    } finally {
        browser.close();
        await studio.stop('SIGKILL');
    }
}

/// A fifth page is told that there are four, and opens when one of them is closed.
async function fifthPagePart() {
    const studio = await Studio.start(sceneFile, '-i', 'path', '--resolution', '64x48');
    const browser = openBrowser();
    const origin = studio.url.split('/#')[0], headers = {Authorization: `Bearer ${studio.url.split('token=')[1]}`};
    const pages = [];
    try {
        for (let i = 0; i < 4; ++i) {
            const page = new AbortController();
            const response = await fetch(`${origin}/v1/events`, {headers, signal: page.signal});
            check(response.status === 200, `page ${i + 1} is open`);
            pages.push({page, response});  // A response without references is closed.
        }
        await browser.open(studio.url);
        await browser.until("document.getElementById('banner-text').textContent.includes('4 pages are open already')", 'the fifth is refused');
        pages.pop().page.abort();
        await browser.until("document.getElementById('banner').hidden && studio.shown[0].passes > 0", 'and opens when one is closed', 30);
    } finally {
        for (const {page} of pages) page.abort();
        browser.close();
        await studio.stop('SIGKILL');
    }
}

/// A view of many triangles, which the processor draws slowly, has fewer of them while it moves.
async function motionPart() {
    const edge = 400;
    const at = (row, column) => { const x = 2 * column / edge - 1, z = 2 * row / edge - 1; return `v ${x} ${0.2 * Math.sin(7 * x) * Math.cos(5 * z)} ${z}`; };
    const rows = [...Array(edge).keys()], corner = (row, column) => row * (edge + 1) + column + 1;
    const vertices = [...rows, edge].flatMap(row => [...rows, edge].map(column => at(row, column)));
    const faces = rows.flatMap(row => rows.map(column => `f ${corner(row, column)} ${corner(row + 1, column)} ${corner(row + 1, column + 1)} ${corner(row, column + 1)}`));
    writeFileSync(join(folder, 'wavy.obj'), [...vertices, ...faces, ''].join('\n'));
    const scene = join(folder, 'wavy.xml');
    writeFileSync(scene, mirrorScene.replace('</scene>', '<shape type="obj"><string name="filename" value="wavy.obj"/></shape></scene>'));
    const studio = await Studio.start(scene, '--idle');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await browser.until('studio.state()?.scene', 'the scene');
        await browser.evaluate("document.getElementById('tab-paths').click()");
        await browser.until('studio.space()?.drawnTriangles >= 320000', 'all triangles are drawn at rest', 60);
        await browser.until('studio.space().fullTime > 0', 'and measured', 60);
        const full = await browser.evaluate('studio.space().fullTime');
        // Where a graphics processor is fast, all triangles are drawn also in motion.
        const most = full > 25 ? 320000 / 8 : Infinity;
        // At once, since the view soon rests again.
        const moving = await browser.evaluate('studio.space().orbit(0.1, 0.05); studio.space().draw(); studio.space().drawnTriangles');
        check(moving > 1000 && moving <= most, `in motion, ${moving} triangles are drawn; all took ${full.toFixed(0)} ms`);
        await browser.until('studio.space().drawnTriangles >= 320000', 'and all of them afterwards', 60);
        // What the page itself needs for a picture.
        const script = await browser.evaluate('(() => { const begin = performance.now(); for (let i = 0; i < 20; ++i) studio.space().draw(); return (performance.now() - begin) / 20; })()');
        console.log(`     the page needs ${script.toFixed(2)} ms for the commands of a picture`);
    } finally {
        browser.close();
        await studio.stop('SIGKILL');
    }
}

/// Instances are drawn where they are, and the cone of the chosen path with it.
async function instancePart() {
    const scene = join(folder, 'instances.xml');
    const ball = '<shape type="shapegroup" id="group"><shape type="sphere"><float name="radius" value="0.2"/></shape></shape>';
    const places = [[-0.6, 0.4, 0], [0.7, -0.5, 0.2]];
    const instances = places.map(([x, y, z]) => `<shape type="instance"><ref id="group"/><transform name="to_world"><translate x="${x}" y="${y}" z="${z}"/></transform></shape>`);
    writeFileSync(scene, mirrorScene.replace('</scene>', `${ball}${instances.join('')}</scene>`));
    const studio = await Studio.start(scene, '--idle');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await browser.until('studio.state()?.scene', 'the scene');
        check(await browser.evaluate("document.getElementById('banner').hidden"), 'nothing to complain about without a run');
        await browser.evaluate("document.getElementById('tab-paths').click()");
        await browser.until('studio.space()?.shapes.length === 4', 'the geometry');
        await idle(browser);
        // What is drawn there changes if the instances are not.
        const drawn = async () => {
            await browser.evaluate('studio.space().redraw()');
            await browser.settle();
            return browser.evaluate(`(() => {
                const c = document.getElementById('space'), copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});
                const context = copy.getContext('2d', {willReadFrequently: true});
                context.drawImage(c, 0, 0);
                return ${JSON.stringify(places)}.map(p => studio.space().project(p)).map(([u, v]) =>
                    [...context.getImageData((u + 1) / 2 * c.width, (1 - v) / 2 * c.height, 1, 1).data].join());
            })()`);
        };
        const all = await drawn();
        await browser.screenshot('11-instances');
        await browser.evaluate('studio.space().shapes.find(s => s.places === 2).places = 0');
        const none = await drawn();
        check(all.every((color, i) => color !== none[i]), `instances are drawn: ${all.join(' ')}, without them ${none.join(' ')}`);
        const cone = await browser.evaluate("import('/space.js').then(m => m.coneOutline([0, 0, 0], [0, 2, 0], 30))");
        check(cone.length === 5 && cone[0].every(p => Math.abs(Math.hypot(...p) - 2) < 1e-9 && Math.abs(p[1] - 2 * Math.cos(Math.PI / 6)) < 1e-9), 'the rim of a cone has its angle');
        await browser.evaluate(`studio.editor().addAll([{points: [[0, 1, 0], [-1, 0.15, 0.1], [0.1, -1, 0.2]], cone: [5, 10], name: ''}])`);
        await browser.evaluate('studio.editor().update()');
        check(await browser.evaluate('studio.space().lines.cones.length') === 10, 'each segment of the chosen path has its cone');
        await browser.screenshot('12-cones');
        check(browser.complaints.length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop('SIGKILL');
    }
}

async function pathPart() {
    const scene = join(folder, 'mirror.xml'), file = join(folder, 'paths.json');
    writeFileSync(scene, mirrorScene);
    const studio = await Studio.start(scene, '-i', 'bdpt');
    const browser = openBrowser(), other = openBrowser();
    try {
        await browser.open(studio.url);
        await browser.until('studio.shown[0].passes > 0', 'an image');
        await browser.evaluate('studio.view.moveCursor(36, 42)');
        check(await tabTo(browser, '#tab-image'), 'the tabs can be reached');
        await key(browser, 'ArrowRight');
        await browser.until('studio.space()?.shapes.length === 3', 'the geometry');
        await idle(browser);
        // A path from the lamp by the mirror to the floor, by keys alone.
        check(await tabTo(browser, '#space'), 'the scene can be reached by Tab');
        await key(browser, 'e', 6);
        await key(browser, 'n');
        for (const p of [[0, 1, 0], [-1, 0.15, 0.1], [0.1, -1, 0.2]]) {
            await crossTo(browser, p);
            await key(browser, 'Enter');
            await browser.settle();
            await idle(browser);
        }
        check(await browser.evaluate(`${paths}[0].points.length`) === 3, 'three points by keys');
        const refused = await browser.evaluate(`${paths}[0].verdict`);
        check(!refused.ok && refused.problem.includes('law of reflection'), `off the law: ${refused.problem}`);
        await browser.screenshot('7-refused');
        await key(browser, ']', 2);
        await key(browser, 'm');
        await browser.settle();
        await idle(browser);
        const verdict = await browser.evaluate(`${paths}[0].verdict`);
        check(verdict.ok, `M moves the point to obey the law ${verdict.problem ?? ''}`);
        check(JSON.parse(readFileSync(file)).length === 1, 'each edit is saved');
        await browser.screenshot('8-mirror-path');
        const before = await browser.evaluate(`${paths}[0].points[1]`);
        await key(browser, 'ArrowUp');
        await browser.settle();
        await idle(browser);
        check(differs(before, await browser.evaluate(`${paths}[0].points[1]`)), 'arrows move the selected point');
        await key(browser, 'z', 1, 2);
        await idle(browser);
        check(!differs(before, await browser.evaluate(`${paths}[0].points[1]`)), 'Ctrl+Z takes it back');
        await key(browser, 'Escape');

        // Another by the pointer alone.
        const [x, y, w, h] = await box(browser, '#space');
        const at = async p => {
            const [u, v] = await browser.evaluate(`studio.space().project(${JSON.stringify(p)})`);
            return [x + (u + 1) / 2 * w, y + (1 - v) / 2 * h];
        };
        const button = async text => {
            const [l, t, bw, bh] = await browser.evaluate(`(() => { const b = [...document.querySelectorAll('#editor button')].find(e => e.textContent === '${text}');
                b.scrollIntoView(); const r = b.getBoundingClientRect(); return [r.left, r.top, r.width, r.height]; })()`);
            await click(browser, l + bw / 2, t + bh / 2);
        };
        await button('New path');
        for (const p of [[0.1, 1, 0.1], [-1, 0.1, 0.3]]) {
            await click(browser, ...await at(p));
            await idle(browser);
        }
        await button('Continue by mirrors');
        await idle(browser);
        check(await browser.evaluate(`${paths}[1].points.length === 3 && ${paths}[1].verdict.ok`), 'the second path, continued by the mirror');
        const end = await browser.evaluate(`${paths}[1].points[2]`);
        const from = await at(end);
        await browser.drag(from, [from[0] + 25, from[1] + 5]);
        await idle(browser);
        check(differs(end, await browser.evaluate(`${paths}[1].points[2]`)), 'the pointer moves a point');
        await button('Undo');
        await idle(browser);
        await browser.until(`${paths}[1].verdict?.ok`, 'the undone move');
        check(!differs(end, await browser.evaluate(`${paths}[1].points[2]`)), 'which can be undone');
        const orbit = await browser.evaluate('studio.space().azimuth');
        await browser.drag([x + 0.9 * w, y + 0.1 * h], [x + 0.8 * w, y + 0.1 * h]);
        check(await browser.evaluate('studio.space().azimuth') !== orbit, 'dragging turns the view');
        await button('Pick from pixel');
        await idle(browser);
        const picked = await browser.evaluate(`${paths}.slice(2).map(p => p.verdict.ok)`);
        check(picked.length > 0 && picked.every(Boolean), `paths of the pixel are picked: ${picked.length}`);
        await browser.screenshot('9-picked');
        await browser.evaluate("document.querySelector('#editor input[type=checkbox]').click()");
        await idle(browser);
        check(JSON.parse(readFileSync(file)).length === 1 + picked.length && existsSync(join(folder, 'paths-off.json')), 'a path can be switched off');
        // Switched on again in a page that was opened in the meantime.
        const all = await browser.evaluate(`${paths}.length`);
        await other.open(studio.url);
        await other.until('studio.state()?.scene', 'the scene in another page');
        await other.evaluate("document.getElementById('tab-paths').click()");
        await other.until(`studio.editor() && ${paths}.length === ${all} && !${paths}[${all - 1}].on`, 'it is in the second file');
        await idle(other);
        await other.evaluate("[...document.querySelectorAll('#editor input[type=checkbox]')].at(-1).click()");
        await idle(other);
        check(JSON.parse(readFileSync(file)).length === all && JSON.parse(readFileSync(join(folder, 'paths-off.json'))).length === 0, 'and then in one file only');
        await browser.evaluate("studio.editor().open('paths.json')");
        await browser.evaluate("studio.editor().open('other.json')");
        await button('Undo');
        await idle(browser);
        check(!existsSync(join(folder, 'other.json')) && await browser.evaluate(`${paths}.length`) === 0, 'undo brings no paths into another file');
        await browser.evaluate("studio.editor().open('paths.json')");
        await browser.evaluate(`studio.editor().paths.unshift(studio.editor().paths.pop()); studio.editor().changed()`);
        await idle(browser);

        // The paths of a pixel, traced again.
        await browser.evaluate("[...document.querySelectorAll('#inspector button')].find(b => b.textContent === 'Trace again').click()");
        await browser.until("document.querySelectorAll('.replayed button').length > 3", 'paths of the pixel');
        check(await browser.evaluate("document.querySelector('.replayed button').textContent.startsWith('L')"), 'with their types');
        await browser.evaluate("document.querySelector('.replayed button').click()");
        await browser.settle();
        await browser.screenshot('10-inspector');
        await checkNames(browser, 'light paths');

        // They are those of one run and one version of the scene.
        const listed = () => browser.evaluate("document.querySelectorAll('.replayed button').length");
        check((await browser.evaluate("document.querySelector('#inspector [role=status]').textContent")).startsWith('pixel (36, 42): '), 'with their pixel');
        await browser.evaluate("studio.server.post('/v1/run', {action: 'start', integrator: 'path', spp: 4})");
        await browser.until('studio.runs.size === 2', 'another run');
        check(await listed() > 3, 'paths stay while their run is shown');
        await browser.evaluate("[...document.querySelectorAll('#run-list button')].find(b => b.getAttribute('aria-label') === 'Show run 2').click()");
        await browser.until('studio.inspector().pixel.run === 2', 'the other run');
        check(await listed() === 0 && await browser.evaluate('studio.space().lines.replayed.length') === 0, 'paths of another run are not shown');
        await browser.evaluate("[...document.querySelectorAll('#inspector button')].find(b => b.textContent === 'Trace again').click()");
        await browser.until("document.querySelectorAll('.replayed button').length > 3", 'paths of the other run');
        writeFileSync(scene, mirrorScene.replace('y="-1"', 'y="-1.25"'));
        await browser.until("document.getElementById('banner-text').textContent.includes('The scene changed')", 'the banner of a changed scene');
        check(await browser.evaluate(`${paths}[0].verdict.ok`), 'the paths are still of the earlier scene');
        await click(browser, ...await browser.evaluate("(() => { const r = document.getElementById('banner-action').getBoundingClientRect(); return [r.left + r.width / 2, r.top + r.height / 2]; })()"));
        await browser.until('studio.state().scene_version === 2 && studio.space().shapes.length === 3', 'the other version');
        await browser.until(`${paths}[0].verdict && !${paths}[0].verdict.ok`, 'the paths are checked again');
        check((await browser.evaluate(`${paths}[0].verdict.problem`)).includes('from the nearest surface'), 'and end above the floor, which has moved');
        const low = await browser.evaluate('Math.min(...studio.space().shapes.map(s => s.low[1]))');
        check(Math.abs(low + 1.25) < 1e-3, `the floor is drawn where it is now: ${low}`);
        check(await listed() === 0 && await browser.evaluate('studio.space().lines.replayed.length') === 0, 'paths of the earlier scene are not shown');
        writeFileSync(scene, mirrorScene);
        await browser.until("document.getElementById('banner-text').textContent.includes('The scene changed')", 'the banner again');
        await browser.evaluate("document.getElementById('banner-action').click()");
        await browser.until(`studio.state().scene_version === 3 && ${paths}[0].verdict?.ok`, 'the first version again');
        await browser.evaluate("studio.server.post('/v1/run', {action: 'remove', run: 2})");

        // Two pages: a stale edit is refused, and the newer list is shown.
        await other.open(studio.url);
        await other.until('studio.shown[0].passes > 0', 'an image in the other page');
        await other.evaluate("document.getElementById('tab-paths').click()");
        await other.until(`studio.editor() && ${paths}.length === ${2 + picked.length}`, 'the paths in the other page');
        await other.evaluate(`(() => { ${paths}[0].name = 'of the other page'; return studio.editor().changed(); })()`);
        await browser.evaluate(`(() => { ${paths}[0].name = 'stale'; return studio.editor().changed(); })()`);
        await browser.until(`${paths}[0].name === 'of the other page'`, 'the newer list');
        check(JSON.parse(readFileSync(file))[0].name === 'of the other page', 'the file has the newer list');
        check(browser.complaints.filter(c => !c.includes('409')).length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);

        // Rendering with these paths.
        await browser.evaluate("document.getElementById('gain-spp').value = 24");
        await button('Render with and without');
        await browser.until("studio.editor().gain.textContent.includes('8 and 8 of 8 seeds') && studio.editor().gain.textContent.includes('the same variance takes')", 'the gain of all seeds', 240);
        const gain = await browser.evaluate('studio.editor().gain.textContent');
        console.log(`     ${gain}`);
        const [without, with_] = await browser.evaluate('[studio.editor().compared.without, studio.editor().compared.with].map(id => [id, studio.runs.get(id).integrator])');
        check(without[1] === 'mlt:user_paths=' && with_[1].startsWith('mlt:user_paths='), `without and with: ${without}; ${with_}`);
        const series = await browser.evaluate(`studio.server.get('/v1/gain?without=${without[0]}&with=${with_[0]}')`);
        check(gain.includes(`1/${Number(series.gain[0].toPrecision(3))} of the time`), `the gain is that of the paths: ${series.gain}`);
        check(await browser.evaluate("[...document.querySelectorAll('#editor tr')].find(r => r.textContent.startsWith('user path')).children[1].textContent") === '–', 'the run without them has no user paths');
        // A region is rendered with the same paths.
        await browser.evaluate("document.getElementById('tab-image').click()");
        await browser.evaluate(`document.querySelector('[aria-label="Show run ${with_[0]}"]').click()`);
        await browser.evaluate('(() => { studio.view.corner = [2, 3]; studio.view.moveCursor(21, 17); })()');
        await browser.until("!document.getElementById('render-region').disabled", 'a region is selected');
        await browser.evaluate("document.getElementById('render-region').click()");
        await browser.until(`studio.state().scene?.width === 20 && studio.shown[0].run > ${with_[0]} && studio.shown[0].passes > 0`, 'the region is rendered', 150);
        const again = await browser.evaluate('studio.runs.get(studio.shown[0].run).integrator');
        check(again === with_[1], `with the same paths: ${again}`);

        check(await studio.stop() === 0, 'Ctrl-C ends with exit code 0');
        check(existsSync(join(folder, 'mirror-1.exr')), 'and writes the images');
    } finally {
        browser.close();
        other.close();
        await studio.stop('SIGKILL');
    }
}

await runParts(foreignPagePart, fifthPagePart, imagePart, keptPart, instancePart, motionPart, pathPart);
