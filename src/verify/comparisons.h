#pragma once
// The comparisons of a method with its references, one function for each kind of mean.

#include "verify/common_classes.h"
#include "verify/verify.h"

namespace etendue {

/// A method, its references, and the classes on which they are compared.
struct Sides {
    const RunSeries& method;
    std::span<const RunSeries> references;
    const CommonClasses& common;
};

/// Compares the image and its tiles, without the light of classes that are not compared.
void compare_images(const Sides& sides, const TileGrid& grid, MethodReport& report);
/// Compares image and tiles with a reference image, where classes are unknown.
void compare_images(const RunSeries& method, const ReferenceImage& reference, const TileGrid& grid,
                    MethodReport& report);
void compare_lengths(const Sides& sides, const VerifyOptions& options,
                     const std::vector<float>& cut_offs, MethodReport& report);
/// Compares single classes, and reports those that are not compared.
void compare_classes(const Sides& sides, MethodReport& report);
/// Compares one technique; `unthinned` is the series of the method without Russian roulette before shadow rays.
TechniqueReport compare_technique(const Technique& technique, const Sides& sides,
                                  const RunSeries& unthinned);

/// Moments over the runs of the method's light in the compared classes that satisfy `belongs(class)`.
template <class Belongs>
Moments method_light(const Sides& sides, const Belongs& belongs) {
    return sides.method.moments([&](const IndependentRun& run) {
        double sum = 0;
        for (const auto& [c, tally] : run.classes)
            if (belongs(c) && sides.common.contains(c)) sum += tally.sum;
        return sum;
    });
}
/// The same light of one reference in one run: of the classes that are compared with it.
template <class Belongs>
double reference_light(const Sides& sides, size_t reference, size_t run, const Belongs& belongs) {
    double sum = 0;
    for (const auto& [c, tally] : sides.references[reference].runs[run].classes) {
        const CommonClasses::Class* k = sides.common.find(c);
        if (k && k->is_common && k->reference == reference && belongs(c)) sum += tally.sum;
    }
    return sum;
}
/// Moments over the runs of the sum of this light over all references.
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
