// Specular connections in `etendue studio`, in a headless browser: a path that one of them made is traced again, and is drawn
// with its chain.
//
//     node check_chain.mjs etendue scene.xml [folder for screenshots]

import {writeFileSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, check, folder, openBrowser, runParts} from './page.mjs';

/// A pane of glass between a floor and a point light, which no other technique of the method finds.
const kEta = 1.5, kLight = [0.4, 0.2, 1.8], kTop = 1.1, kBottom = 0.9;
const scene = `<scene version="3.0.0"><sensor type="perspective"><float name="fov" value="60"/>
<transform name="to_world"><lookat origin="0,-3,0.7" target="0,0,0.2" up="0,0,1"/></transform><film type="hdrfilm">
<integer name="width" value="40"/><integer name="height" value="30"/></film></sensor>
<shape type="rectangle"><transform name="to_world"><scale value="2"/></transform></shape>
<shape type="cube"><transform name="to_world"><scale value="2,2,0.1"/><translate z="1"/></transform>
<bsdf type="dielectric"><float name="int_ior" value="${kEta}"/><float name="ext_ior" value="1"/></bsdf></shape>
<emitter type="point"><point name="position" value="${kLight}"/></emitter></scene>`;
const file = join(folder, 'pane.xml');
writeFileSync(file, scene);

const minus = (a, b) => a.map((v, i) => v - b[i]);
/// The horizontal part of the direction between two points.
function aside(from, to) {
    const d = minus(to, from), length = Math.hypot(...d);
    return [d[0] / length, d[1] / length];
}
const isNear = (a, b, tolerance) => Math.hypot(...minus(a, b)) < tolerance;

/// What the view shows along the segments of a path: by segment the brightness at some of its points.
const alongSegments = points => `(() => {
    const c = document.getElementById('space'), points = ${JSON.stringify(points)};
    const copy = Object.assign(document.createElement('canvas'), {width: c.width, height: c.height});
    const context = copy.getContext('2d', {willReadFrequently: true});
    context.drawImage(c, 0, 0);
    return points.slice(1).map((to, i) => [0.2, 0.35, 0.5, 0.65, 0.8].map(f => {
        const at = studio.space().project(points[i].map((v, k) => v + f * (to[k] - v)));
        const x = Math.round((at[0] + 1) / 2 * c.width), y = Math.round((1 - at[1]) / 2 * c.height);
        return Math.max(...context.getImageData(x - 1, y - 1, 3, 3).data.filter((_, k) => k % 4 < 3));
    }));
})()`;

await runParts(async () => {
    const studio = await Studio.start(file, '-i', 'path:specular_connections=on,max_depth=4');
    const browser = openBrowser();
    try {
        await browser.open(studio.url);
        await browser.until('studio.shown[0].passes >= 8', 'eight passes');
        await browser.evaluate("document.getElementById('find-worst').click()");
        await browser.until("document.querySelectorAll('#worst .replayed button').length === 20", 'the worst pixels');
        await browser.evaluate("document.querySelector('#worst .replayed button').click()");
        await browser.until('studio.inspector()?.paths.length > 0 && studio.inspector().chosen === 0', 'its paths are traced again', 150);
        const path = await browser.evaluate('studio.inspector().paths[0]');
        check(path.technique.strategy === 'specular' && path.technique.s === 3 && path.technique.t === 2 && path.type === 'LSSDE',
            `a specular connection made the path: ${path.type} ${JSON.stringify(path.technique)}`);
        const text = await browser.evaluate("document.querySelector('#inspector .replayed button').textContent");
        check(text.startsWith('LSSDE') && text.includes('specular 3,2'), `the list tells it: ${text}`);

        const points = path.points.map(p => p.slice(0, 3)), [light, top, bottom, floor] = points;
        check(isNear(light, kLight, 1e-5) && Math.abs(top[2] - kTop) < 1e-5 && Math.abs(bottom[2] - kBottom) < 1e-5 && Math.abs(floor[2]) < 1e-5,
            `the chain leads from the light through both faces of the pane to the floor: ${JSON.stringify(points)}`);
        const air = aside(light, top), glass = aside(top, bottom), below = aside(bottom, floor);
        check(isNear(air, glass.map(v => kEta * v), 1e-4) && isNear(air, below, 1e-4), "and obeys Snell's law");

        const drawn = await browser.evaluate('studio.space().lines.replayed.find(l => l.marks).points');
        check(drawn.length === 5 && points.every((p, i) => isNear(p, drawn[i], 1e-6)), 'the path is drawn with all points of the chain');
        await browser.evaluate('studio.space().lookFromOutside()');
        await browser.settle();
        await browser.screenshot('chain-1-drawn');
        const chain = points.slice(0, 4);
        const with_ = await browser.evaluate(alongSegments(chain));
        await browser.evaluate("[...document.querySelectorAll('#inspector button')].find(b => b.textContent === 'Clear').click()");
        await browser.settle();
        const without = await browser.evaluate(alongSegments(chain));
        check(with_.every((s, i) => s.every((v, k) => v > without[i][k] + 20)), `each segment is seen: ${JSON.stringify(with_)}, without the path ${JSON.stringify(without)}`);
        check(browser.complaints.length === 0, `the console is quiet: ${browser.complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop();
    }
});
