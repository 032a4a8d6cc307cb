#include "color/metals.h"

#include <algorithm>
#include <iterator>

namespace etendue {
namespace {

struct Metal {
    const char* name;
    ConductorIor ior;
};

/// Measured n and k as collected by the LUXPOP database from the SOPRA tables and from [Palik 1985,
/// 1991], each turned into a colour by spectrum_to_rgb under equal energy, which is also Mitsuba's
/// convention for its named conductors (so a spectrally flat n gets a larger red component). "-e"
/// marks the extraordinary ray. AlSb is missing: its table ends at 590 nm.
constexpr Metal kMetals[] = {
    {"a-C", {{2.9439f, 2.2273f, 1.9672f}, {0.8874f, 0.7994f, 0.8148f}}},
    {"Ag", {{0.1553f, 0.1167f, 0.1383f}, {4.8282f, 3.1224f, 2.1461f}}},
    {"Al", {{1.6574f, 0.8804f, 0.521f}, {9.2234f, 6.2699f, 4.8347f}}},
    {"AlAs", {{3.6049f, 3.2333f, 2.2142f}, {0.0007f, 0, 0.0074f}}},
    {"Au", {{0.1429f, 0.3754f, 1.4412f}, {3.9828f, 2.3857f, 1.6024f}}},
    {"Be", {{4.1848f, 3.1853f, 2.7827f}, {3.8352f, 3.0104f, 2.8674f}}},
    {"Cr", {{4.3695f, 2.9166f, 1.6542f}, {5.2062f, 4.2316f, 3.753f}}},
    {"CsI", {{2.1447f, 1.7025f, 1.6615f}, {0, 0, 0}}},
    {"Cu", {{0.2009f, 0.9238f, 1.1016f}, {3.913f, 2.4532f, 2.1411f}}},
    {"Cu2O", {{3.5515f, 2.9501f, 2.7506f}, {0.1141f, 0.194f, 0.6055f}}},
    {"Cu_palik", {{0.2131f, 0.9198f, 1.1018f}, {3.9217f, 2.4575f, 2.1356f}}},
    {"CuO", {{3.2473f, 2.448f, 2.2091f}, {0.521f, 0.5701f, 0.7217f}}},
    {"d-C", {{2.7127f, 2.3186f, 2.2276f}, {0, 0, 0}}},
    {"Hg", {{2.3988f, 1.4401f, 0.9092f}, {6.3273f, 4.3722f, 3.4202f}}},
    {"HgTe", {{4.7788f, 3.2314f, 2.6586f}, {1.6315f, 1.5809f, 1.7284f}}},
    {"Ir", {{3.0861f, 2.0823f, 1.6171f}, {5.5918f, 4.0673f, 3.2657f}}},
    {"K", {{0.064f, 0.0464f, 0.0382f}, {2.1041f, 1.349f, 0.9128f}}},
    {"Li", {{0.2658f, 0.1956f, 0.2208f}, {3.5401f, 2.3112f, 1.6679f}}},
    {"MgO", {{2.0894f, 1.6509f, 1.594f}, {0, 0, 0}}},
    {"Mo", {{4.4837f, 3.5254f, 2.7748f}, {4.1111f, 3.4211f, 3.149f}}},
    {"Na", {{0.0603f, 0.0561f, 0.062f}, {3.1791f, 2.1126f, 1.5784f}}},
    {"Nb", {{3.4199f, 2.7903f, 2.3944f}, {3.4412f, 2.7379f, 2.5785f}}},
    {"Ni", {{2.3671f, 1.6635f, 1.4663f}, {4.4986f, 3.0503f, 2.3443f}}},
    {"Rh", {{2.5857f, 1.8603f, 1.5537f}, {6.7819f, 4.7033f, 3.9741f}}},
    {"Se", {{4.0588f, 2.8431f, 2.8192f}, {0.754f, 0.6385f, 0.5212f}}},
    {"Se-e", {{5.7236f, 4.1659f, 4.0794f}, {0.8709f, 1.1054f, 1.564f}}},
    {"SiC", {{3.1721f, 2.5262f, 2.478f}, {0, 0, 0}}},
    {"SnTe", {{4.5241f, 1.9818f, 1.281f}, {0, 0, 0}}},
    {"Ta", {{2.0625f, 2.3931f, 2.6266f}, {2.4081f, 1.7417f, 1.9459f}}},
    {"Te", {{7.39f, 4.4823f, 2.6361f}, {3.2558f, 3.5273f, 3.2906f}}},
    {"Te-e", {{7.5087f, 4.2966f, 2.3691f}, {5.5836f, 4.9475f, 3.9958f}}},
    {"ThF4", {{1.8306f, 1.4423f, 1.3869f}, {0, 0, 0}}},
    {"TiC", {{3.7003f, 2.8376f, 2.581f}, {3.2654f, 2.3518f, 2.1716f}}},
    {"TiN", {{1.6483f, 1.1507f, 1.3788f}, {3.3682f, 1.9436f, 1.1015f}}},
    {"TiO2", {{3.4563f, 2.802f, 2.9033f}, {0.0001f, 0, 0.0006f}}},
    {"TiO2-e", {{3.1063f, 2.5134f, 2.5809f}, {0, 0, 0.0002f}}},
    {"V", {{4.2774f, 3.5131f, 2.7599f}, {3.491f, 2.8897f, 3.1099f}}},
    {"VC", {{3.6573f, 2.7529f, 2.5313f}, {3.0681f, 2.1989f, 1.9621f}}},
    {"VN", {{2.8654f, 2.1194f, 1.939f}, {3.0321f, 2.0562f, 1.6155f}}},
    {"W", {{4.3705f, 3.3005f, 2.9967f}, {3.5004f, 2.6051f, 2.2719f}}},
};

const Metal* find(std::string_view name) {
    const auto* it = std::find_if(std::begin(kMetals), std::end(kMetals),
                                  [&](const Metal& m) { return m.name == name; });
    return it == std::end(kMetals) ? nullptr : it;
}

}  // namespace

std::optional<ConductorIor> named_metal(std::string_view name) {
    constexpr std::string_view kSuffix = "_palik";
    const Metal* metal = find(name);
    if (!metal && name.ends_with(kSuffix)) {
        name.remove_suffix(kSuffix.size());
        metal = find(name);
    }
    if (!metal) return {};
    return metal->ior;
}

std::vector<std::string> metal_names() {
    std::vector<std::string> names;
    for (const Metal& m : kMetals) names.emplace_back(m.name);
    return names;
}

}  // namespace etendue
