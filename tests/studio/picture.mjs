// Makes the picture of docs/studio.md: two runs of a scene, one beside the other.
//
//     node tests/studio/picture.mjs build/release/etendue scenes/demo.xml docs/figures/studio
//
// writes image.png. Needs Node.js and Chromium; see browser.mjs.

import {Studio, openBrowser, runParts, sceneFile} from './page.mjs';

const kPasses = 16;

async function picture() {
    const studio = await Studio.start(sceneFile, '-i', 'path', '--resolution', '480x360');
    const browser = openBrowser();
    const choose = (id, value) => browser.evaluate(`(() => { const s = document.getElementById('${id}'); s.value = '${value}'; s.dispatchEvent(new Event('change')); })()`);
    try {
        await browser.open(studio.url);
        await browser.until(`studio.shown[0].passes >= ${kPasses}`, 'the first run', 600);
        await choose('method', 'bdpt');
        await browser.evaluate("document.querySelector('#run-form button[type=submit]').click()");
        await browser.until(`studio.runs.size === 2 && studio.shown[0].run === 2 && studio.shown[0].passes >= ${kPasses}`, 'the second run', 600);
        await choose('against', '1');
        await browser.until('studio.view.pictures[1]', 'the first run beside it');
        await browser.until("document.querySelector('#plot svg')", 'the convergence plot');
        await browser.evaluate("document.getElementById('pixel-section').scrollIntoView()");
        await browser.screenshot('image');
    } finally {
        browser.close();
        await studio.stop();
    }
}

await runParts(picture);
