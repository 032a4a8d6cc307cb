#include "integrator/photons.h"

namespace etendue {

void Photons::trace(const PassContext& pass, const Bidirectional& paths,
                    const TechniqueCounts& counts, float radius) {
    radius_ = radius;
    chunks_.resize(pass.chunks);
    for (LightPaths::Chunk& chunk : chunks_) chunk.clear();
    pass.for_each_light_path([&](uint64_t chunk, const SampleContext& c, Workspace& work) {
        paths.light_path(c, counts, work);
        chunks_[chunk].add(work.y);
    });
    paths_.assemble(chunks_);

    std::vector<PointGrid::Entry> entries;
    const auto vertices = paths_.vertices();
    for (uint32_t i = 0; i < vertices.size(); ++i)
        if (vertices[i].may_connect) entries.push_back({vertices[i].p, i});
    grid_.build(entries, radius);
}

float gather_radius(float given, const Scene& scene) {
    return given > 0 ? given : 0.003f * scene.bounds().radius();
}

ParamInfo radius_param() {
    return {"radius", ParamKind::Float, "0",
            "Distance within which vertices form pairs, in scene units; 0: 0.3 % of the radius of "
            "the scene's bounds."};
}

}  // namespace etendue
