// A task in a headless browser, once by keys alone and once by the pointer alone: draw three user paths through the keyhole
// of scenes/keyhole.xml, render with and without them, and read the gain that the page states. The fields of the page are
// typed into in both.
//
//     node check_keyhole.mjs etendue scenes/keyhole.xml [folder for screenshots]
//
// With KEYHOLE_SPP, KEYHOLE_SEEDS and KEYHOLE_RESOLUTION, the renderings are as long as the gain takes to be seen.

import {readFileSync, rmSync} from 'node:fs';
import {join} from 'node:path';

import {Studio, box, check, click, crossTo, folder, idle, key, openBrowser, paths, runParts, sceneFile, tabTo, type} from './page.mjs';

const kSpp = Number(process.env.KEYHOLE_SPP ?? 2), kSeeds = Number(process.env.KEYHOLE_SEEDS ?? 3);
const kResolution = process.env.KEYHOLE_RESOLUTION ?? '32x24';
const kMinutes = 60;

/// Where the paths begin on the lamp, which faces +x behind the door; and the middle of the keyhole.
const kStarts = [[-0.97, 0.15, 0.1], [-0.97, 0.07, -0.02], [-0.97, 0.24, 0.05]], kKeyhole = [-0.6, 0.01, 0];
const kCone = 2, kDisc = 0.06;

const space = (browser, what) => browser.evaluate(`studio.space().${what}`);
/// What a click in the middle of the view would hit at `point`.
const seen = (browser, point) => browser.evaluate(`studio.space().pick(...studio.space().project(${JSON.stringify(point)})).then(p => p?.shape ?? '')`);

/// A hand for each way to use the page: turn the view, move the slider that cuts away, press a button, add a point, and type.
const keys = browser => ({
    async focus() { check(await tabTo(browser, '#space'), 'the scene can be reached by Tab'); },
    async turn(azimuth, height) {
        await this.focus();
        const steps = async (now, wanted, plus, minus) => { const n = Math.round((wanted - now) / 0.08); await key(browser, n > 0 ? plus : minus, Math.abs(n)); };
        await steps(await space(browser, 'azimuth'), azimuth, 'a', 'd');
        await steps(await space(browser, 'height'), height, 'w', 's');
    },
    async cut(enough) {
        await tabTo(browser, '#cut');
        for (let i = 0; i < 200 && !await enough(); ++i) await key(browser, 'ArrowRight');
    },
    async press(selector) {
        check(await tabTo(browser, selector), `${selector} can be reached by Tab`);
        await key(browser, ' ');
    },
    async addPoint(point) {
        await this.focus();
        await crossTo(browser, point);
        await key(browser, 'Enter');
    },
    async newPath() {
        await this.focus();
        await key(browser, 'n');
    },
    async lookFromPoint() {
        await this.focus();
        await key(browser, 'v');
    },
    async select(selector) { await tabTo(browser, selector); },
    async leave() { await key(browser, 'Tab'); },
    async showPaths() {
        await tabTo(browser, '#tab-image');
        await key(browser, 'ArrowRight');
    },
});

const pointer = browser => {
    const middle = async selector => {
        await browser.evaluate(`document.querySelector('${selector}').scrollIntoView()`);
        const [x, y, w, h] = await box(browser, selector);
        return [x + w / 2, y + h / 2, w, h];
    };
    const on = async point => {
        const [x, y, w, h] = await box(browser, '#space');
        const [u, v] = await space(browser, `project(${JSON.stringify(point)})`);
        return [x + (u + 1) / 2 * w, y + (1 - v) / 2 * h];
    };
    return {
        async turn(azimuth, height) {
            const [x, y] = await middle('#space');
            const dx = (await space(browser, 'azimuth') - azimuth) / 0.006, dy = (await space(browser, 'height') - height) / 0.006;
            // Away from the points of paths, which a drag would move.
            const from = [x - dx / 2, y - 200];
            await browser.drag(from, [from[0] + dx, from[1] + dy]);
        },
        async cut(enough) {
            // The slider's handle, from its left end.
            const [x, y, w] = await middle('#cut'), left = x - w / 2 + 8;
            await browser.mouse('mousePressed', left, y);
            let at = left;
            for (; at < left + w && !await enough(); ++at) await browser.mouse('mouseMoved', at, y);
            --at;
            await browser.mouse('mouseReleased', at, y);
        },
        async press(selector) { await click(browser, ...(await middle(selector)).slice(0, 2)); },
        async addPoint(point) { await click(browser, ...await on(point)); },
        async newPath() { await this.press('#editor [title=N]'); },
        async lookFromPoint() { await this.press('#editor [title=V]'); },
        async select(selector) {
            const [x, y] = await middle(selector);
            for (const clickCount of [1, 2, 3]) {
                await browser.mouse('mousePressed', x, y, {clickCount});
                await browser.mouse('mouseReleased', x, y, {clickCount});
            }
        },
        async leave() { await click(browser, ...(await middle('#editor-title')).slice(0, 2)); },
        async showPaths() { await this.press('#tab-paths'); },
    };
};

async function task(name, makeHand) {
    const file = join(folder, 'paths.json');
    const studio = await Studio.start(sceneFile, '--idle', '--resolution', kResolution);
    const browser = openBrowser();
    const hand = makeHand(browser);
    try {
        await browser.open(studio.url);
        await browser.until('studio.state()?.scene', 'the scene');
        await hand.showPaths();
        await browser.until('studio.space()?.shapes.length > 5', 'the geometry');
        await idle(browser);
        for (const start of kStarts) {
            await hand.newPath();
            await idle(browser);
            // The lamp, from the side of the room, through what is cut away.
            await hand.press('#space-tools [title="Look from outside the scene"]');
            await hand.turn(-Math.PI / 2, 0);
            await browser.settle();
            await hand.cut(async () => await seen(browser, start) === 'lamp');
            await hand.addPoint(start);
            await idle(browser);
            // And what is seen from the lamp through the keyhole.
            await hand.lookFromPoint();
            await browser.settle();
            await hand.addPoint(kKeyhole);
            await idle(browser);
            await browser.screenshot(`keyhole-${name}-${kStarts.indexOf(start) + 1}`);
        }
        for (const i of kStarts.keys())
            for (const [field, value] of [['cone', kCone], ['radius', kDisc]]) {
                await hand.select(`[data-key=${field}${i}]`);
                await type(browser, value);
                await hand.leave();
                await idle(browser);
            }
        const drawn = await browser.evaluate(`${paths}.map(p => [p.points.length, p.cone, p.radius, p.verdict?.ok, p.verdict?.problem ?? ''])`);
        check(drawn.length === 3 && drawn.every(p => p[0] === 2 && p[1] === kCone && p[2] === kDisc && p[3]), `${name}: three paths through the keyhole: ${JSON.stringify(drawn)}`);
        if (!drawn.every(p => p[3])) throw new Error(`${name}: no paths to render with`);
        const saved = JSON.parse(readFileSync(file));
        check(saved.length === 3 && saved.every(p => p.points.length === 2 && p.points[1][0] > -0.6), `${name}: which are saved`);
        for (const [id, value] of [['#gain-spp', kSpp], ['#gain-seeds', kSeeds]]) {
            await hand.select(id);
            await type(browser, value);
        }
        await hand.press('#render-both');
        await browser.until(`studio.editor().gain.textContent.includes('${kSeeds} and ${kSeeds} of ${kSeeds} seeds')`, 'the renderings', 60 * kMinutes);
        await browser.until("/the same variance takes|No gain:/.test(studio.editor().gain.textContent)", 'the gain, or why there is none');
        const text = await browser.evaluate("[...studio.editor().gain.querySelectorAll('p, tr')].map(e => e.textContent).join('\\n     ')");
        check(/user path/.test(text), `${name}: the page states what user paths are worth:\n     ${text}`);
        await browser.screenshot(`keyhole-${name}`);
        check(browser.complaints.length === 0, `${name}: the console is quiet: ${browser.complaints.join('; ')}`);
    } finally {
        browser.close();
        await studio.stop('SIGKILL');
        rmSync(file, {force: true});
    }
}

await runParts(...[["keys", keys], ["pointer", pointer]].filter(([name]) => (process.env.KEYHOLE_HANDS ?? name) === name).map(([name, hand]) => () => task(name, hand)));
