#pragma once
// The scene: immutable and ready to render. Shapes with their materials and emitters, the sensor, and the few questions
// that path sampling asks of them.

#include <algorithm>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "bsdf/material.h"
#include "emitter/emitter.h"
#include "film/film.h"
#include "geometry/accelerator.h"
#include "math/distribution.h"
#include "sensor/sensor.h"

namespace etendue {

/// Index of a medium; kVacuum where nothing absorbs.
using MediumId = int16_t;
inline constexpr MediumId kVacuum = -1;

struct SceneShape {
    const Shape* shape = nullptr;
    const Material* material = nullptr;
    const Emitter* emitter = nullptr;
    MediumId interior = kVacuum, exterior = kVacuum;
    bool is_interface =
        false;  ///< interior and exterior are told; else the medium is that of the walk.
    bool is_mesh = false;
    bool needs_tangents = false;  ///< The material asks for dpdu.
    std::string name;

    /// Of an interface with the normal `ng`: the medium on the side of `d`.
    MediumId medium_toward(Vec3 ng, Vec3 d) const { return dot(ng, d) < 0 ? interior : exterior; }
};

/// The media on a ray's way.
struct Passage {
    MediumId medium = kVacuum;  ///< Before the query: at the origin; after it: where the ray ended.
    Rgb attenuation = Rgb(1);   ///< By absorption, up to there.
};

/// Where a ray met the scene.
struct SurfaceHit {
    SurfaceGeometry geometry;
    const SceneShape* shape;
    SurfaceLocation location;
    float t;
};

/// Settings that the file gives for the integrator and the sampler, before the command line.
struct RenderDefaults {
    std::string integrator;  ///< Empty where the file names none.
    std::vector<std::pair<std::string, std::string>>
        integrator_params;  ///< Those this project knows.
    int spp = 0;
};

class Scene {
public:
    Scene();
    ~Scene();
    Scene(Scene&&) noexcept;

    // -- Queries of path sampling; thread-safe.

    /// Nearest surface. Masked surfaces let the ray pass with probability 1 - opacity, decided by `u`, which is
    /// rescaled by each decision. `passage` follows the ray through the media that such surfaces bound.
    bool intersect(const Ray& ray, float u, SurfaceHit& hit, Passage& passage) const;
    /// The same where media do not matter.
    bool intersect(const Ray& ray, float u, SurfaceHit& hit) const;
    /// Geometry of a surface point that a ray met before.
    SurfaceGeometry surface(const SurfaceLocation& location) const;
    const SceneShape& shape(uint32_t index) const { return shapes_[index]; }
    /// Transmittance of masks along the open segment between two points, their surfaces left out by offsets along
    /// `ng`; 0 where something is in the way. For a point at infinity use `transmittance_to_infinity`.
    float transmittance(Vec3 a, Vec3 ng_a, Vec3 b, Vec3 ng_b) const;
    float transmittance_to_infinity(Vec3 a, Vec3 ng_a, Vec3 d) const;

    /// Attenuation over `distance`, which may be infinite, in a medium.
    Rgb attenuation(MediumId medium, float distance) const {
        if (medium == kVacuum) return Rgb(1);
        return exp(media_[size_t(medium)] * -std::min(distance, std::numeric_limits<float>::max()));
    }
    /// Attenuation by the media along the segment of transmittance(), which begins in `medium`; of no meaning where
    /// something is in the way.
    Rgb attenuation(MediumId medium, Vec3 a, Vec3 ng_a, Vec3 b, Vec3 ng_b) const;
    Rgb attenuation_to_infinity(MediumId medium, Vec3 a, Vec3 ng_a, Vec3 d) const;
    /// Whether rays pass from one medium into another without a vertex.
    bool has_open_boundaries() const { return has_open_boundaries_; }

    /// Emitter drawn by power. `u` is not read where there is but one.
    const Emitter& sample_emitter(double u) const {
        return *emitters_[emitters_.size() == 1 ? 0u : selection_.sample(u).index];
    }
    bool has_emitters() const { return !selection_.empty(); }
    bool has_emitter_choice() const { return emitters_.size() > 1; }
    /// Whether some emitter can never be hit.
    bool has_delta_emitters() const { return has_delta_emitters_; }

    const Sensor& sensor() const { return *sensor_; }
    const FilmGeometry& film() const { return film_; }
    const ReconstructionFilter& filter() const { return filter_; }
    const std::vector<const Emitter*>& infinite_emitters() const { return infinite_; }

    // -- What `info` and the command line ask.

    const std::vector<SceneShape>& shapes() const { return shapes_; }
    const std::vector<std::unique_ptr<Emitter>>& emitters() const { return emitters_; }
    const RenderDefaults& defaults() const { return defaults_; }
    const std::vector<std::string>& warnings() const { return warnings_; }
    const Bounds3& bounds() const { return bounds_; }
    const std::string& file() const { return file_; }
    bool has_masks() const { return has_masks_; }
    bool has_media() const { return !media_.empty(); }

    struct Statistics {
        size_t triangles = 0, quadrics = 0, instances = 0, materials = 0, textures = 0;
        size_t geometry_bytes = 0, texture_bytes = 0, accelerator_bytes = 0;
    };
    const Statistics& statistics() const { return statistics_; }

private:
    friend class SceneBuilder;
    void fill_hit(const RayHit& raw, SurfaceHit& hit) const;
    static Ray segment(Vec3 a, Vec3 ng_a, Vec3 b, Vec3 ng_b);
    float masked_transmittance(const Ray& ray) const;
    Rgb attenuation(MediumId medium, const Ray& ray) const;
    /// Calls `passes(hit)` for the surfaces on a ray in their order, until it returns false or there are no more;
    /// returns what is left of the ray then. `hit.t` is the distance from the surface before.
    template <class Passes>
    Ray for_each_surface(Ray ray, const Passes& passes) const;

    std::string file_;
    std::vector<std::unique_ptr<Shape>> owned_shapes_;
    std::unique_ptr<TextureCache> images_;
    std::vector<std::unique_ptr<Texture>> textures_;
    std::vector<std::unique_ptr<Material>> materials_;
    std::vector<std::unique_ptr<Emitter>> emitters_;
    std::vector<SceneShape> shapes_;  ///< By the accelerator's shape index.
    std::vector<Rgb> media_;          ///< Extinction σ_t, 1/length.
    std::vector<const Emitter*> infinite_;
    AliasTable selection_;
    Accelerator accelerator_;
    std::unique_ptr<Sensor> sensor_;
    FilmGeometry film_;
    ReconstructionFilter filter_ = ReconstructionFilter::box();
    RenderDefaults defaults_;
    Bounds3 bounds_;
    bool has_masks_ = false;
    bool has_open_boundaries_ = false;
    bool has_delta_emitters_ = false;
    std::vector<std::string> warnings_;
    Statistics statistics_;
};

}  // namespace etendue
