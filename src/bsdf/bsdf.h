#pragma once
// Scattering at a surface point in world space. `Bsdf` evaluates one lobe, or a mixture of lobes, in shading frames,
// and applies the corrections that depend on the direction of transport: that for shading normals and the η² of
// refraction [Veach 1997, §5.2–5.3].

#include <variant>

#include "bsdf/coatedconductor.h"
#include "bsdf/conductor.h"
#include "bsdf/dielectric.h"
#include "bsdf/diffuse.h"
#include "bsdf/diffusetransmission.h"
#include "bsdf/fresnelblend.h"
#include "bsdf/openpbr.h"
#include "bsdf/orennayar.h"
#include "bsdf/phong.h"
#include "bsdf/plastic.h"
#include "bsdf/principled.h"
#include "bsdf/roughconductor.h"
#include "bsdf/roughdielectric.h"
#include "bsdf/roughplastic.h"
#include "bsdf/thindielectric.h"

namespace etendue {

/// The closed set of lobes; trivially copyable, at most 64 bytes each.
using Lobe =
    std::variant<DiffuseLobe, ConductorLobe, RoughConductorLobe, DielectricLobe, ThinDielectricLobe,
                 RoughDielectricLobe, PlasticLobe, RoughPlasticLobe, PhongLobe, PrincipledLobe,
                 OrenNayarLobe, FresnelBlendLobe, DiffuseTransmissionLobe, CoatedMirrorLobe,
                 CoatedConductorLobe, OpenPbrLobe>;

/// One lobe in its shading frame; a mixture is a list of them.
struct BsdfComponent {
    Frame frame;
    Lobe lobe;
    /// Factor of the lobe's value. The probability that sample() chooses the lobe is its share of the sum of all weights.
    float weight = 1;
    /// In the arena of the walk that made it; nullptr for the last one.
    const BsdfComponent* next = nullptr;
};

/// Everything that scatters at one surface point.
class Bsdf {
public:
    Bsdf() = default;

    /// f̃·|wi·ng|, where f̃ is the radiance BSDF for light that arrives from the light's side and leaves to the eye's,
    /// corrected for shading normals; densities are in solid angle. `wo` points to the predecessor of the walk in
    /// `mode`. With strict normals it is zero where the shading normal and the geometric normal see `wi` or `wo` on
    /// different sides.
    BsdfEval eval(Vec3 wo, Vec3 wi, TransportMode mode) const;
    /// A direction with weight f̃·|wi·ng| / pdf; empty where the walk ends.
    std::optional<BsdfSample> sample(Vec3 wo, float u_lobe, Vec2 u, TransportMode mode) const;

    /// The direction of delta event number `event` for `wo`, to recompute a path whose vertices have moved; empty where
    /// there is no such event. Numbers are those of BsdfSample::event: 2·(index of the component) + transmits.
    std::optional<BsdfSample> sample_delta(Vec3 wo, uint8_t event, TransportMode mode) const;

    /// Probability that sample() gives a delta event for `wo`.
    float delta_probability(Vec3 wo, TransportMode mode) const {
        return has_delta_ ? sum_delta_probabilities(wo, mode) : 0.0f;
    }

    /// Upper bound of eval(wo, w).pdf over the directions w of a cone; kInf where none is known.
    float max_pdf(Vec3 wo, const DirectionCone& cone) const;
    /// Shading normal where the only lobe is diffuse, so that sampling has density cos θ/π about it; empty otherwise.
    std::optional<Vec3> diffuse_normal() const {
        return only_diffuse_lobe() ? std::optional(first_.frame.n) : std::nullopt;
    }

    /// Whether any lobe is smooth, so that connections are possible here.
    bool has_smooth() const { return has_smooth_; }
    bool has_delta() const { return has_delta_; }
    /// Whether sample() reads u_lobe.
    bool uses_lobe_choice() const { return uses_lobe_choice_; }
    /// α of the sharpest smooth lobe; 0 where all lobes are delta.
    float roughness() const { return only_diffuse_lobe() ? 1.0f : sharpest_roughness(); }
    Rgb albedo_estimate() const;
    Vec3 shading_normal() const { return first_.frame.n; }
    /// First of the linked components.
    const BsdfComponent& front() const { return first_; }

private:
    friend class ComponentList;
    friend class ComponentArena;
    /// The lobe where it is the only one and diffuse, the most frequent case; nullptr for others.
    const DiffuseLobe* only_diffuse_lobe() const {
        return first_.next ? nullptr : std::get_if<DiffuseLobe>(&first_.lobe);
    }
    float sharpest_roughness() const;
    float sum_delta_probabilities(Vec3 wo, TransportMode mode) const;
    /// A sample of sample_component(), with the probabilities of the components.
    BsdfSample normalized(BsdfSample s) const;

    Vec3 ng_;
    bool has_strict_normals_ = true;
    bool has_smooth_ = false, has_delta_ = false;
    bool uses_lobe_choice_ = false;
    float total_weight_ = 1;
    BsdfComponent first_;
};

}  // namespace etendue
