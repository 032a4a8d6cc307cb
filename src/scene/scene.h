#pragma once
// The scene, immutable and ready to render: shapes with their materials and emitters, the sensor, and the queries of
// path sampling.

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bsdf/material.h"
#include "description/scene_description.h"
#include "emitter/emitter.h"
#include "film/film_geometry.h"
#include "geometry/accelerator.h"
#include "math/distribution.h"
#include "sensor/sensor.h"
#include "texture/bitmap.h"

namespace etendue {

/// Index of a medium; kVacuum where nothing absorbs.
using MediumId = int16_t;
inline constexpr MediumId kVacuum = -1;
/// Emitter::medium of an emitter that lies in more than one.
inline constexpr MediumId kSeveralMedia = -2;

/// The images that the material of an object of the description reads; a map, since shapes refer to its entries.
using ImagesOfMaterials = std::map<int, std::vector<const BitmapTexture*>>;

struct SceneShape {
    const Shape* shape = nullptr;
    const Material* material = nullptr;
    const Emitter* emitter = nullptr;
    MediumId interior = kVacuum, exterior = kVacuum;
    /// Whether interior or exterior are given; otherwise both sides have the medium of the walk.
    bool is_interface = false;
    bool is_mesh = false;
    bool needs_tangents = false;                   ///< Whether the material uses dpdu and dpdv.
    std::span<const BitmapTexture* const> images;  ///< Those that the material reads.
    std::string name;

    /// nullptr for other shapes.
    const TriangleMesh* mesh() const {
        return is_mesh ? static_cast<const TriangleMesh*>(shape) : nullptr;
    }
    /// The medium of an interface with normal `ng` on the side of `d`.
    MediumId medium_toward(Vec3 ng, Vec3 d) const { return dot(ng, d) < 0 ? interior : exterior; }
};

/// Whether specular connections may have delta events at a surface. Some maps of normals are not known in double, and masks
/// have no certain events; their paths are left to hits.
inline bool may_be_in_chain(const SceneShape& shape) {
    return shape.material->is_opaque() && shape.material->has_jet();
}

/// A shape whose material has delta events alone, or one of those of an instance.
struct ClearShape {
    const Shape* shape;
    uint32_t instance;  ///< kNoInstance outside of instances.
    Vec3 center;        ///< Of a sphere around it, in world space.
    float radius;
};

/// The media along a ray.
struct Passage {
    MediumId medium = kVacuum;  ///< Input: at the origin. Output: where the ray ends.
    Rgb attenuation = Rgb(1);   ///< Output: by absorption along the ray.
};

/// Intersection of a ray with the scene, at distance t.
struct SurfaceHit {
    /// Without the geometry, which Scene::complete() makes.
    SurfaceHit() {}

    union {
        SurfaceGeometry geometry;
    };
    bool has_geometry;  ///< Whether `geometry` is known, see Scene::find().
    const SceneShape* shape;
    RayHit location;  ///< As the ray tracer has it: its `t` is in units of the ray's direction.
    float t;
};

/// Settings of the scene file for integrator and sampler; the command line overrides them.
struct RenderDefaults {
    /// Largest rr_depth of paths that are longer: in closed rooms nothing but roulette ends walks.
    static constexpr int kLatestRoulette = 1000;

    /// As in the file, without children; of a wrapper the one nested in it. Files have full paths. What it means, and
    /// whether it is valid, is for scene_integrator() to say.
    std::optional<SceneObject> integrator;
    std::string integrator_problem;  ///< Why one of its files cannot be used; empty otherwise.
    bool is_lenient = false;  ///< Whether what is unknown about it is left out, with a warning.
    int spp = 0;              ///< 0: not given.
};

class Scene {
public:
    Scene();
    ~Scene();
    Scene(Scene&&) noexcept;

    /// The same scene, of which a film of this size shows what film() shows. It shares everything else with this one, and
    /// needs no memory of its own beyond a list of the shapes.
    Scene seen_by_film(int width, int height) const;

    // -- Queries of path sampling; thread-safe.

    /// The nearest surface; false where there is none. Masked surfaces let the ray pass with probability 1 - opacity,
    /// decided by `u`, which is rescaled at each one. `passage` tracks the media bounded by masked surfaces.
    bool intersect(const Ray& ray, float u, SurfaceHit& hit, Passage& passage) const;
    /// The same without media.
    bool intersect(const Ray& ray, float u, SurfaceHit& hit) const;
    /// The two parts of intersect(): find() leaves out the geometry of most hits, and complete() adds it. Between the two parts,
    /// several rays can ask for the memory that complete() reads: first prefetch_primitive(), then prefetch_vertices(),
    /// which reads what the former asked for; and after it for what the material reads. Here `u` is `number()`, which is called
    /// where the ray meets the first masked surface.
    bool find(const Ray& ray, const std::function<float()>& number, SurfaceHit& hit,
              Passage& passage) const;
    /// Like find(), but the ray passes all surfaces that are not certain to stop it, and `passage.attenuation` has their
    /// factors 1 - opacity, too.
    bool find_certain(const Ray& ray, SurfaceHit& hit, Passage& passage) const;
    void complete(SurfaceHit& hit) const;
    void prefetch_primitive(const SurfaceHit& hit) const {
        if (const TriangleMesh* mesh = hit.shape->mesh()) mesh->prefetch_face(hit.location.prim);
    }
    void prefetch_vertices(const SurfaceHit& hit) const {
        if (const TriangleMesh* mesh = hit.shape->mesh())
            mesh->prefetch_vertices(hit.location.prim);
    }
    void prefetch_images(const SurfaceHit& hit) const;
    /// Geometry of a surface point.
    SurfaceGeometry surface(const SurfaceLocation& location) const;
    /// Differential geometry where the line o + t·d meets the primitive at `location`, see Shape::jet(). `ns` is the normal of
    /// the material's shading, as seen from the line's origin.
    std::optional<SurfaceJet> jet(const SurfaceLocation& location, Vec3d o, Vec3d d,
                                  double near) const;
    const std::vector<ClearShape>& clear_shapes() const { return clear_shapes_; }
    /// Whether any surface may reflect or refract by delta events that chains may have, see may_be_in_chain().
    bool may_have_chains() const { return may_have_chains_; }
    /// A point of a clear shape: `u_prim` chooses a primitive uniformly, and `u` a point of it.
    Vec3 point_on(const ClearShape& clear, float u_prim, Vec2 u) const;
    /// Probability that a ray meets the surface there.
    float opacity(const SurfaceLocation& location) const;
    const SceneShape& shape(uint32_t index) const { return shapes_[index]; }
    const Accelerator& accelerator() const { return owned_->accelerator; }
    /// Transmittance of masks along the open segment from `a` to `b`; 0 where an opaque surface is in between.
    float transmittance(const RayEnd& a, const RayEnd& b) const;
    float transmittance_to_infinity(const RayEnd& a, Vec3 d) const;

    /// Attenuation over `distance`, which may be infinite, in a medium.
    Rgb attenuation(MediumId medium, float distance) const {
        if (medium == kVacuum) return Rgb(1);
        return exp(media_[size_t(medium)] * -std::min(distance, std::numeric_limits<float>::max()));
    }
    /// Attenuation by the media along the segment of transmittance(), which starts in `medium`; undefined where
    /// transmittance() is 0.
    Rgb attenuation(MediumId medium, const RayEnd& a, const RayEnd& b) const;
    Rgb attenuation_to_infinity(MediumId medium, const RayEnd& a, Vec3 d) const;
    /// The medium at a point, on the front of the surface if it lies on one: the one that the nearest boundaries around
    /// it have on its side.
    MediumId medium_around(const RayEnd& at) const;
    /// The medium in which light of a finite emitter starts at a point of it.
    MediumId medium_at(const Emitter& emitter, const RayEnd& at) const {
        return emitter.medium != kSeveralMedia ? MediumId(emitter.medium) : medium_around(at);
    }
    /// The medium at the lens.
    MediumId sensor_medium() const { return sensor_medium_; }
    /// Whether rays can pass from one medium into another without a vertex, through masked surfaces.
    bool has_open_boundaries() const { return has_open_boundaries_; }

    /// An emitter chosen with probability proportional to its power, but finite emitters together and infinite emitters
    /// together at least one time in four. `u` is not used where there is only one.
    const Emitter& sample_emitter(double u) const {
        return *emitters()[emitters().size() == 1 ? 0u : selection_.sample(u).index];
    }
    const Emitter& emitter(uint32_t index) const { return *emitters()[index]; }
    bool has_emitters() const { return !selection_.empty(); }
    bool has_emitter_choice() const { return emitters().size() > 1; }
    /// Whether an emitter has large tables, see Emitter::has_large_tables().
    bool has_large_emitter_tables() const { return has_large_emitter_tables_; }
    /// Whether any emitter is delta.
    bool has_delta_emitters() const { return has_delta_emitters_; }

    const Sensor& sensor() const { return *sensor_; }
    const FilmGeometry& film() const { return film_; }
    const ReconstructionFilter& filter() const { return filter_; }
    const std::vector<const Emitter*>& infinite_emitters() const { return infinite_; }

    // -- Information for the command line.

    const std::vector<SceneShape>& shapes() const { return shapes_; }
    const std::vector<std::unique_ptr<Emitter>>& emitters() const { return owned_->emitters; }
    const RenderDefaults& defaults() const { return defaults_; }
    const std::vector<std::string>& warnings() const { return warnings_; }
    const Bounds3& bounds() const { return bounds_; }
    const std::string& file() const { return file_; }
    bool has_masks() const { return has_masks_; }
    /// Names of the sensors in the file, and which of them is used.
    const std::vector<std::string>& sensor_names() const { return sensor_names_; }
    size_t sensor_index() const { return sensor_index_; }
    bool has_media() const { return !media_.empty(); }

    struct Statistics {
        size_t triangles = 0, quadrics = 0, instances = 0, materials = 0, textures = 0;
        size_t geometry_bytes = 0, texture_bytes = 0, accelerator_bytes = 0;
    };
    const Statistics& statistics() const { return statistics_; }

private:
    friend class SceneBuilder;
    /// What scenes that differ in their films share.
    struct Owned {
        std::vector<std::shared_ptr<const Shape>> shapes;
        std::unique_ptr<TextureCache> images;
        std::vector<std::unique_ptr<Texture>> textures;
        std::vector<std::unique_ptr<Material>> materials;
        ImagesOfMaterials images_of_materials;
        std::vector<std::unique_ptr<Emitter>> emitters;
        Accelerator accelerator;

        Owned();
        ~Owned();
    };
    Scene(const Scene&);  ///< Shares what the other one owns.
    bool locate(const Ray& ray, SurfaceHit& hit) const;
    /// find(), where `stops(opacity)` decides which masked surfaces stop the ray.
    template <class Stops>
    bool find_where(const Ray& ray, const Stops& stops, SurfaceHit& hit, Passage& passage) const;
    Ray segment(const RayEnd& a, const RayEnd& b) const;
    float transmittance(const Ray& ray) const;
    /// The same by a walk from surface to surface.
    float masked_transmittance(const Ray& ray) const;
    Rgb attenuation(MediumId medium, const Ray& ray) const;
    /// For the surfaces along a ray in order: sets `hit`, calls `stops()` while it has no geometry, and unless that returns
    /// true, `passes()` when it has, until that returns false or there are no more surfaces; returns the length of the rest of
    /// the ray. `hit.t` is the distance from the previous surface.
    template <class Stops, class Passes>
    float for_each_surface(Ray ray, SurfaceHit& hit, const Stops& stops,
                           const Passes& passes) const;

    std::string file_;
    std::shared_ptr<Owned> owned_;
    std::vector<SceneShape> shapes_;  ///< By the accelerator's shape index.
    std::vector<ClearShape> clear_shapes_;
    bool may_have_chains_ = false;
    std::vector<Rgb> media_;  ///< Extinction σ_t, 1/length.
    std::vector<const Emitter*> infinite_;
    AliasTable selection_;
    std::shared_ptr<const Sensor> sensor_;
    FilmGeometry film_;
    ReconstructionFilter filter_ = ReconstructionFilter::box();
    RenderDefaults defaults_;
    Bounds3 bounds_;
    std::vector<std::string> sensor_names_;
    size_t sensor_index_ = 0;
    bool has_masks_ = false;
    bool has_open_boundaries_ = false;
    bool has_delta_emitters_ = false;
    bool has_large_emitter_tables_ = false;
    MediumId sensor_medium_ = kVacuum;
    std::vector<std::string> warnings_;
    Statistics statistics_;
};

}  // namespace etendue
