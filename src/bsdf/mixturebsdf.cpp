// Sum of materials with constant weights, as in Mitsuba 0.6.
//   weights (required)  one number per material, separated by blanks or commas
//   ensure_energy_conservation (true)   whether weights are divided by their sum if it exceeds one
//   nested: as many bsdfs, none of them masked

#include <charconv>

#include "bsdf/wrapper.h"

namespace etendue {
namespace {

class MixtureBsdf final : public Material {
public:
    MixtureBsdf(const Params& params, MaterialContext& context)
        : nested_(nested_materials(params, context, 1, 1000)), weights_(read_weights(params)) {
        if (weights_.size() != nested_.size())
            params.fail("weights", fmt::format("there are {} weights, but {} nested bsdfs",
                                               weights_.size(), nested_.size()));
        for (const Material* m : nested_)
            if (!m->is_opaque())
                params.fail(
                    "bsdf \"mixturebsdf\" cannot hold a masked material (to mask it, put the "
                    "\"mixturebsdf\" into a \"mask\")");
        check_components(params, *this);
        if (!params.flag("ensure_energy_conservation", true)) return;
        float sum = 0;
        for (float w : weights_) sum += w;
        for (float& w : weights_) w /= std::max(sum, 1.0f);
    }

    void append(const SurfacePoint& point, const Frame& frame, float weight,
                ComponentList& list) const override {
        for (size_t i = 0; i < nested_.size(); ++i)
            nested_[i]->append(point, frame, weight * weights_[i], list);
    }
    bool is_transmissive() const override {
        return any([](const Material& m) { return m.is_transmissive(); });
    }
    bool is_two_sided() const override {
        return any([](const Material& m) { return m.is_two_sided(); });
    }
    bool may_be_smooth() const override {
        return any([](const Material& m) { return m.may_be_smooth(); });
    }
    bool may_have_delta() const override {
        return any([](const Material& m) { return m.may_have_delta(); });
    }
    int max_components() const override {
        int sum = 0;
        for (const Material* m : nested_) sum += m->max_components();
        return sum;
    }
    bool perturbs_normals() const override {
        return any([](const Material& m) { return m.perturbs_normals(); });
    }
    Rgb mean_albedo() const override {
        Rgb sum;
        for (size_t i = 0; i < nested_.size(); ++i) sum += nested_[i]->mean_albedo() * weights_[i];
        return sum;
    }

private:
    template <class Test>
    bool any(const Test& test) const {
        return std::any_of(nested_.begin(), nested_.end(),
                           [&](const Material* m) { return test(*m); });
    }
    static std::vector<float> read_weights(const Params& params) {
        const std::string text = params.text("weights", "");
        std::vector<float> weights;
        for (size_t at = text.find_first_not_of(" ,"); at != text.npos;) {
            const size_t end = std::min(text.find_first_of(" ,", at), text.size());
            float w = 0;
            const auto [stop, error] = std::from_chars(text.data() + at, text.data() + end, w);
            if (error != std::errc() || stop != text.data() + end || !(w >= 0 && w < kInf))
                params.fail("weights", fmt::format("expected numbers of at least 0, found \"{}\"",
                                                   text.substr(at, end - at)));
            weights.push_back(w);
            at = text.find_first_not_of(" ,", end);
        }
        return weights;
    }

    std::vector<const Material*> nested_;
    std::vector<float> weights_;
};

}  // namespace

MaterialEntry mixturebsdf_entry() {
    return {{"bsdf",
             "mixturebsdf",
             "Sum of materials with constant weights.",
             {{"weights", ParamKind::String, "", "One number for each material."},
              {"ensure_energy_conservation", ParamKind::Bool, "true",
               "Whether weights are divided by their sum if it exceeds 1. Without it, such a "
               "mixture may "
               "reflect more light than it receives."},
              {"bsdf", ParamKind::Object, "", "The nested materials."}}},
            make_material<MixtureBsdf>};
}

}  // namespace etendue
