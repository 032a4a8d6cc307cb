#pragma once
// The comparisons of a method with its references: which means are held together, one function for each kind.

#include "verify/common_classes.h"
#include "verify/verify.h"

namespace etendue {

/// A method, its references, and the classes that they are compared on.
struct Sides {
    const RunSeries& method;
    std::span<const RunSeries> references;
    const CommonClasses& common;
};

/// Image and tiles, from the film, without the classes that are not compared.
void compare_images(const Sides& sides, const TileGrid& grid, MethodReport& report);
/// The same with an image, which has no classes.
void compare_images(const RunSeries& method, const ReferenceImage& reference, const TileGrid& grid,
                    MethodReport& report);
void compare_lengths(const Sides& sides, const VerifyOptions& options,
                     const std::vector<float>& cut_offs, MethodReport& report);
/// Classes on their own, and what is left out.
void compare_classes(const Sides& sides, MethodReport& report);
/// `unthinned` is the method without roulette before shadow rays.
TechniqueReport compare_technique(const Technique& technique, const Sides& sides,
                                  const RunSeries& unthinned);

/// Light of the method, or of its references, in the compared classes for which `belongs(class)`; over the runs.
template <class Belongs>
Moments method_light(const Sides& sides, const Belongs& belongs) {
    return sides.method.moments([&](const IndependentRun& run) {
        double sum = 0;
        for (const auto& [c, tally] : run.classes)
            if (belongs(c) && sides.common.contains(c)) sum += tally.sum;
        return sum;
    });
}
/// The part of the reference's light that comes from one of the references.
template <class Belongs>
double reference_light(const Sides& sides, size_t reference, size_t run, const Belongs& belongs) {
    double sum = 0;
    for (const auto& [c, tally] : sides.references[reference].runs[run].classes) {
        const CommonClasses::Class* k = sides.common.find(c);
        if (k && k->is_common && k->reference == reference && belongs(c)) sum += tally.sum;
    }
    return sum;
}
template <class Belongs>
Moments reference_light(const Sides& sides, const Belongs& belongs) {
    Moments m;
    for (size_t run = 0; run < sides.method.runs.size(); ++run) {
        double sum = 0;
        for (size_t i = 0; i < sides.references.size(); ++i)
            sum += reference_light(sides, i, run, belongs);
        m.add(sum);
    }
    return m;
}

}  // namespace etendue
