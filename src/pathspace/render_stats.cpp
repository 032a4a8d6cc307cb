#include "pathspace/render_stats.h"

namespace etendue {

RenderStats& RenderStats::operator+=(const RenderStats& o) {
    phases += o.phases;
    eye_paths += o.eye_paths;
    light_paths += o.light_paths;
    vertices += o.vertices;
    walk_rays += o.walk_rays;
    shadow_rays += o.shadow_rays;
    visible += o.visible;
    joins_skipped += o.joins_skipped;
    pairs += o.pairs;
    visible_pairs += o.visible_pairs;
    trials += o.trials;
    trial_rays += o.trial_rays;
    for (size_t i = 0; i < pairs_by_trials.size(); ++i) {
        pairs_by_trials[i] += o.pairs_by_trials[i];
        chains_by_trials[i] += o.chains_by_trials[i];
    }
    chains += o.chains;
    chain_seeds += o.chain_seeds;
    chain_trials += o.chain_trials;
    chain_failures += o.chain_failures;
    chain_rays += o.chain_rays;
    bounds_exceeded += o.bounds_exceeded;
    runaways += o.runaways;
    rejected += o.rejected;
    return *this;
}

}  // namespace etendue
