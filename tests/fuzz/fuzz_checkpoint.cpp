// Any bytes as a checkpoint, with right checksums: a std::runtime_error, or sums that can be read and written again.

#include <cstring>
#include <stdexcept>

#include "fuzz_target.h"
#include "math/content_hash.h"
#include "render/merging.h"
#include "render/statistics_section.h"

namespace etendue::fuzz {
namespace {

/// Without it, the checksums would stop all mutations.
std::string with_checksums(std::string bytes) {
    constexpr size_t kFile = 16, kName = 32, kHeader = 48;
    for (size_t at = kFile; bytes.size() >= kHeader && at <= bytes.size() - kHeader;) {
        uint64_t size = 0;
        std::memcpy(&size, &bytes[at + kName], sizeof size);
        if (size > bytes.size() - at - kHeader) break;
        const std::string name(&bytes[at], ::strnlen(&bytes[at], kName));
        const uint64_t hash = ContentHash()
                                  .add(name)
                                  .add_piece({&bytes[at + kHeader], size_t(size)})
                                  .add(size)
                                  .value();
        std::memcpy(&bytes[at + kName + sizeof size], &hash, sizeof hash);
        at += kHeader + size;
    }
    return bytes;
}

void read(const std::string& bytes) {
    try {
        CheckpointFile checkpoint(SectionReader(bytes, "fuzz.etd"));
        checkpoint.check();
        const RenderTotals totals = checkpoint.totals();
        require(totals.film->image().size() == totals.film->geometry().pixel_count());
        require(totals.film->variance().size() == totals.film->geometry().pixel_count());
        totals.film->error();
        totals.film->mean_luminance();
        if (totals.techniques) totals.techniques->images();
        std::vector<CheckpointFile> parts;
        parts.push_back(std::move(checkpoint));
        parts.emplace_back(SectionReader(bytes, "again.etd"));
        Merging(std::move(parts)).totals();
    } catch (const std::runtime_error&) {
    }
}

void run(std::string_view bytes) {
    read(std::string(bytes));
    read(with_checksums(std::string(bytes)));
}

/// Sums of three passes, with and without groups and technique images.
std::vector<std::string> seeds() {
    std::vector<std::string> all;
    const FilmGeometry geometry{5, 4, 1, 1, 4, 3};
    const ReconstructionFilter filter = ReconstructionFilter::box();
    for (const int groups : {0, 2})
        for (const int depth : {0, 3}) {
            Film film(geometry, filter);
            if (groups > 0) film.set_groups(groups);
            TechniqueImages techniques(geometry, filter, std::max(depth, 1));
            for (int pass = 0; pass < 3; ++pass) {
                film.begin_pass(0);
                for (uint64_t i = 0; i < geometry.pixel_count(); ++i)
                    film.add_eye(i, Rgb(float(i) + 0.5f * float(pass)));
                film.end_pass();
                techniques.add({{2.5f, 2.5f}, 0}, {Strategy::NextEvent, 1, 2}, Rgb(1), 1, 1);
                techniques.end_pass();
            }
            SectionWriter to;
            to.begin("rendering");
            to.put(std::string(
                R"({"scene":"a.xml","integrator":"bdpt","estimator":"unbiased","passes":[[0,0,3]],)"
                R"("merged":false,"film":[5,4,1,1,4,3],"technique_depth":)" +
                std::to_string(depth) + R"(,"conditions":[["sampler","sobol"],["seed","0"]]})"));
            save_statistics({}, 1.5, to);
            film.save(to);
            if (depth > 0) techniques.save(to);
            to.begin("passes");
            to.put(std::vector<double>{0.5, 0.5, 0.5});
            to.put(std::vector<uint64_t>{0, 0, 0});
            all.push_back(to.take());
            // The seeds are to be read, apart from mutations.
            require(CheckpointFile(SectionReader(all.back(), "seed")).totals().film->passes() == 3);
        }
    return all;
}

const Register kRegister({.name = "checkpoint", .run = run, .seeds = seeds});

}  // namespace
}  // namespace etendue::fuzz
