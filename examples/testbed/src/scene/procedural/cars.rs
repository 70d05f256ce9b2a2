//! The bodies and lights of the cars, which [`Traffic`] moves.

use girandole::{LightWorld, Policy};

use super::assembly::{Assembly, Design, Placed};
use super::palette::Palette;
use super::rng::Rng;
use super::roads::Roads;
use super::traffic::Traffic;
use super::vehicles::{car_designs, car_transform};
use super::{Scene, SceneError};

/// Most cars; no city has room for as many.
const MAX_CARS: usize = 1 << 20;

/// All cars of the city.
pub struct Cars {
    traffic: Traffic,
    /// The placement of each car of `traffic`.
    placed: Vec<Placed>,
}

impl Cars {
    /// Chooses `count` cars and lets them drive for a while, so that none is parked.
    pub fn new(
        assembly: &mut Assembly,
        palette: &mut Palette,
        roads: Roads,
        count: usize,
        seed: u64,
    ) -> Result<Self, SceneError> {
        if count > MAX_CARS {
            return Err(SceneError(format!("{count} cars: the limit is {MAX_CARS}")));
        }
        let kinds = car_designs(assembly, palette)?;
        let mut rng = Rng::new(seed, 0xca45);
        let choose = |_| {
            // Many sedans and hatchbacks, fewer vans and taxis, few buses.
            let (body, designs) = &kinds[rng.pick(&[0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4])];
            (body.size()[0], rng.pick(designs))
        };
        let (lengths, chosen): (Vec<f32>, Vec<Design>) = (0..count).map(choose).unzip();
        let traffic = Traffic::new(roads, &lengths, seed)?;
        let mut placed = Vec::with_capacity(count);
        for (car, design) in chosen.into_iter().enumerate() {
            let pose = traffic.pose(car, 0.0);
            placed.push(assembly.place(design, car_transform(pose.position, pose.angle), Policy::RefitOnly)?);
        }
        Ok(Self { traffic, placed })
    }

    /// Moves the cars to where they are at a time, in seconds.
    pub fn drive(&mut self, time: f64, scene: &mut Scene, world: &mut LightWorld) -> Result<(), SceneError> {
        self.traffic.advance(time);
        for (car, placed) in self.placed.iter().enumerate() {
            let pose = self.traffic.pose(car, time);
            let transform = car_transform(pose.position, pose.angle);
            let object = &mut scene.objects[placed.object];
            // Cars that wait cause no work.
            if object.transform == transform {
                continue;
            }
            object.transform = transform;
            if let Some(instance) = placed.instance {
                world.move_instance(instance, transform)?;
            }
        }
        Ok(())
    }
}
