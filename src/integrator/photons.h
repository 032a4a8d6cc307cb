#pragma once
// The light vertices of a pass from which eye vertices choose partners.

#include "integrator/bidirectional.h"
#include "pathspace/light_paths.h"
#include "pathspace/point_grid.h"

namespace etendue {

/// A light vertex y_{s-1} near an eye vertex, with as much as is known without looking it up.
struct Partner {
    Vec3 p;
    uint32_t vertex;
    int s;
    ArrivalSide side;
    uint8_t gloss_before;  ///< Of y_{s-2}, or of its event.
    /// Luminance, times the area density of y_{s-1} over the disc's where it is larger.
    float flux;
    // For may_pair to set:
    float estimate;  ///< Of what its join adds to the pixel, which PairWorth corrects.
    float rate;      ///< The share of such partners that is used.
    bool drops_eye, drops_light;
};

class Photons {
public:
    /// Traces all light paths of the pass, with the techniques t ≤ 1, and keeps them. Connectible vertices y_i, i ≥ 1,
    /// can be found within `radius`.
    /// Throws std::runtime_error where they would take more than `max_bytes`.
    void trace(const PassContext& pass, const Bidirectional& paths, const TechniqueCounts& counts,
               float radius, uint64_t max_bytes);

    const LightPaths& paths() const { return paths_; }
    /// Ends the last pass: its light vertices, if there are any, tell the density of partners within `radius`.
    void learn_density(float radius);
    const PairDensity& density() const { return density_; }
    /// Of the partners.
    float mean_flux() const { return mean_flux_; }
    /// Calls use(partner) for the light vertices nearer to `p` than the radius for which may_pair(partner) holds.
    template <class MayPair, class Use>
    void for_each_near(Vec3 p, const MayPair& may_pair, const Use& use) const {
        constexpr int kBatch = 32;
        Partner found[kBatch];
        int count = 0;
        const auto use_found = [&] {
            for (int i = 0; i < count; ++i) paths_.prefetch_head(found[i].vertex);
            for (int i = 0; i < count; ++i) use(found[i]);
            count = 0;
        };
        grid_.for_each_near(p, radius_, [&](const PointGrid::Entry& e) {
            Partner& partner = found[count];
            partner = {.p = e.p,
                       .vertex = e.index,
                       .s = size_of(e),
                       .side = ArrivalSide::from_bits(e.tag >> 16),
                       .gloss_before = uint8_t(e.tag & 0xff),
                       .flux = e.weight,
                       .estimate = 0,
                       .rate = 1,
                       .drops_eye = true,
                       .drops_light = true};
            if (!may_pair(partner)) return;
            paths_.prefetch(e.index);
            ++count;
            if (count == kBatch) use_found();
        });
        use_found();
    }
    float radius() const { return radius_; }

private:
    /// Tags of the grid's entries: arrival side, s or kManyVertices, and gloss before.
    static constexpr uint32_t kManyVertices = 255;
    int size_of(const PointGrid::Entry& e) const {
        const uint32_t s = e.tag >> 8 & 0xff;
        return s < kManyVertices ? int(s) : paths_.depth(e.index) + 1;
    }
    /// The grid of connectible vertices, and their mean flux.
    void index();

    LightPaths paths_;
    PointGrid grid_;
    PairDensity density_;
    float radius_ = 0, mean_flux_ = 0;
    LightPathCollector collector_;
};

/// r_i = r_1 i^((α-1)/2), so that bias and noise both vanish [Knaus & Zwicker 2011, eq. 15].
class RadiusSchedule {
public:
    /// `doc` of the first radius.
    static std::vector<ParamInfo> params(const char* doc);
    /// `default_share`: first radius, where none is given, of the radius of the scene's bounds.
    RadiusSchedule(const IntegratorParams& params, float default_share);

    /// Of the pass with this index, from 0.
    float radius(const Scene& scene, uint32_t pass) const;
    bool shrinks() const { return alpha_ < 1; }

private:
    float first_, alpha_, default_share_;
};

}  // namespace etendue
