//! The sizes that a program may name: only what it names is linked.
//!
//! One that is not here is a line more.
#![expect(missing_docs, reason = "the types of sizes say what the numbers in the names are")]

use crate::arx::ArxSize;
use crate::ekf::EkfSize;
use crate::kalman::KalmanSize;
use crate::luenberger::LuenbergerSize;
use crate::rls::RlsSize;
use crate::rst::{RstPlaceSize, RstSize};
use crate::tuner::TunerSize;
use crate::ukf::UkfSize;

#[unsafe(no_mangle)]
pub static thetahat_rls_1: RlsSize = RlsSize::new::<1>();
#[unsafe(no_mangle)]
pub static thetahat_rls_2: RlsSize = RlsSize::new::<2>();
#[unsafe(no_mangle)]
pub static thetahat_rls_3: RlsSize = RlsSize::new::<3>();
#[unsafe(no_mangle)]
pub static thetahat_rls_4: RlsSize = RlsSize::new::<4>();
#[unsafe(no_mangle)]
pub static thetahat_rls_5: RlsSize = RlsSize::new::<5>();
#[unsafe(no_mangle)]
pub static thetahat_rls_6: RlsSize = RlsSize::new::<6>();
#[unsafe(no_mangle)]
pub static thetahat_rls_7: RlsSize = RlsSize::new::<7>();
#[unsafe(no_mangle)]
pub static thetahat_rls_8: RlsSize = RlsSize::new::<8>();
#[unsafe(no_mangle)]
pub static thetahat_rls_9: RlsSize = RlsSize::new::<9>();
#[unsafe(no_mangle)]
pub static thetahat_rls_10: RlsSize = RlsSize::new::<10>();
#[unsafe(no_mangle)]
pub static thetahat_rls_11: RlsSize = RlsSize::new::<11>();
#[unsafe(no_mangle)]
pub static thetahat_rls_12: RlsSize = RlsSize::new::<12>();
#[unsafe(no_mangle)]
pub static thetahat_rls_13: RlsSize = RlsSize::new::<13>();
#[unsafe(no_mangle)]
pub static thetahat_rls_14: RlsSize = RlsSize::new::<14>();
#[unsafe(no_mangle)]
pub static thetahat_rls_15: RlsSize = RlsSize::new::<15>();
#[unsafe(no_mangle)]
pub static thetahat_rls_16: RlsSize = RlsSize::new::<16>();
#[unsafe(no_mangle)]
pub static thetahat_arx_1: ArxSize = ArxSize::arx::<1>();
#[unsafe(no_mangle)]
pub static thetahat_arx_2: ArxSize = ArxSize::arx::<2>();
#[unsafe(no_mangle)]
pub static thetahat_arx_3: ArxSize = ArxSize::arx::<3>();
#[unsafe(no_mangle)]
pub static thetahat_arx_4: ArxSize = ArxSize::arx::<4>();
#[unsafe(no_mangle)]
pub static thetahat_arx_5: ArxSize = ArxSize::arx::<5>();
#[unsafe(no_mangle)]
pub static thetahat_arx_6: ArxSize = ArxSize::arx::<6>();
#[unsafe(no_mangle)]
pub static thetahat_arx_7: ArxSize = ArxSize::arx::<7>();
#[unsafe(no_mangle)]
pub static thetahat_arx_8: ArxSize = ArxSize::arx::<8>();
#[unsafe(no_mangle)]
pub static thetahat_arx_9: ArxSize = ArxSize::arx::<9>();
#[unsafe(no_mangle)]
pub static thetahat_arx_10: ArxSize = ArxSize::arx::<10>();
#[unsafe(no_mangle)]
pub static thetahat_arx_11: ArxSize = ArxSize::arx::<11>();
#[unsafe(no_mangle)]
pub static thetahat_arx_12: ArxSize = ArxSize::arx::<12>();
#[unsafe(no_mangle)]
pub static thetahat_armax_1: ArxSize = ArxSize::armax::<1>();
#[unsafe(no_mangle)]
pub static thetahat_armax_2: ArxSize = ArxSize::armax::<2>();
#[unsafe(no_mangle)]
pub static thetahat_armax_3: ArxSize = ArxSize::armax::<3>();
#[unsafe(no_mangle)]
pub static thetahat_armax_4: ArxSize = ArxSize::armax::<4>();
#[unsafe(no_mangle)]
pub static thetahat_armax_5: ArxSize = ArxSize::armax::<5>();
#[unsafe(no_mangle)]
pub static thetahat_armax_6: ArxSize = ArxSize::armax::<6>();
#[unsafe(no_mangle)]
pub static thetahat_armax_7: ArxSize = ArxSize::armax::<7>();
#[unsafe(no_mangle)]
pub static thetahat_armax_8: ArxSize = ArxSize::armax::<8>();
#[unsafe(no_mangle)]
pub static thetahat_armax_9: ArxSize = ArxSize::armax::<9>();
#[unsafe(no_mangle)]
pub static thetahat_armax_10: ArxSize = ArxSize::armax::<10>();
#[unsafe(no_mangle)]
pub static thetahat_armax_11: ArxSize = ArxSize::armax::<11>();
#[unsafe(no_mangle)]
pub static thetahat_armax_12: ArxSize = ArxSize::armax::<12>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_1_1: KalmanSize = KalmanSize::new::<1, 1>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_2_1: KalmanSize = KalmanSize::new::<2, 1>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_2_2: KalmanSize = KalmanSize::new::<2, 2>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_3_1: KalmanSize = KalmanSize::new::<3, 1>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_3_2: KalmanSize = KalmanSize::new::<3, 2>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_3_3: KalmanSize = KalmanSize::new::<3, 3>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_4_1: KalmanSize = KalmanSize::new::<4, 1>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_4_2: KalmanSize = KalmanSize::new::<4, 2>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_4_3: KalmanSize = KalmanSize::new::<4, 3>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_5_1: KalmanSize = KalmanSize::new::<5, 1>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_5_2: KalmanSize = KalmanSize::new::<5, 2>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_5_3: KalmanSize = KalmanSize::new::<5, 3>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_6_1: KalmanSize = KalmanSize::new::<6, 1>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_6_2: KalmanSize = KalmanSize::new::<6, 2>();
#[unsafe(no_mangle)]
pub static thetahat_kalman_6_3: KalmanSize = KalmanSize::new::<6, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_1_1: EkfSize = EkfSize::new::<1, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_2_1: EkfSize = EkfSize::new::<2, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_2_2: EkfSize = EkfSize::new::<2, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_3_1: EkfSize = EkfSize::new::<3, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_3_2: EkfSize = EkfSize::new::<3, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_3_3: EkfSize = EkfSize::new::<3, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_4_1: EkfSize = EkfSize::new::<4, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_4_2: EkfSize = EkfSize::new::<4, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_4_3: EkfSize = EkfSize::new::<4, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_5_1: EkfSize = EkfSize::new::<5, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_5_2: EkfSize = EkfSize::new::<5, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_5_3: EkfSize = EkfSize::new::<5, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_6_1: EkfSize = EkfSize::new::<6, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_6_2: EkfSize = EkfSize::new::<6, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ekf_6_3: EkfSize = EkfSize::new::<6, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_1_1: UkfSize = UkfSize::new::<1, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_2_1: UkfSize = UkfSize::new::<2, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_2_2: UkfSize = UkfSize::new::<2, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_3_1: UkfSize = UkfSize::new::<3, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_3_2: UkfSize = UkfSize::new::<3, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_3_3: UkfSize = UkfSize::new::<3, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_4_1: UkfSize = UkfSize::new::<4, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_4_2: UkfSize = UkfSize::new::<4, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_4_3: UkfSize = UkfSize::new::<4, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_5_1: UkfSize = UkfSize::new::<5, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_5_2: UkfSize = UkfSize::new::<5, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_5_3: UkfSize = UkfSize::new::<5, 3>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_6_1: UkfSize = UkfSize::new::<6, 1>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_6_2: UkfSize = UkfSize::new::<6, 2>();
#[unsafe(no_mangle)]
pub static thetahat_ukf_6_3: UkfSize = UkfSize::new::<6, 3>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_1_1: LuenbergerSize = LuenbergerSize::new::<1, 1>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_2_1: LuenbergerSize = LuenbergerSize::new::<2, 1>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_2_2: LuenbergerSize = LuenbergerSize::new::<2, 2>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_3_1: LuenbergerSize = LuenbergerSize::new::<3, 1>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_3_2: LuenbergerSize = LuenbergerSize::new::<3, 2>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_3_3: LuenbergerSize = LuenbergerSize::new::<3, 3>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_4_1: LuenbergerSize = LuenbergerSize::new::<4, 1>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_4_2: LuenbergerSize = LuenbergerSize::new::<4, 2>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_4_3: LuenbergerSize = LuenbergerSize::new::<4, 3>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_5_1: LuenbergerSize = LuenbergerSize::new::<5, 1>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_5_2: LuenbergerSize = LuenbergerSize::new::<5, 2>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_5_3: LuenbergerSize = LuenbergerSize::new::<5, 3>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_6_1: LuenbergerSize = LuenbergerSize::new::<6, 1>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_6_2: LuenbergerSize = LuenbergerSize::new::<6, 2>();
#[unsafe(no_mangle)]
pub static thetahat_luenberger_6_3: LuenbergerSize = LuenbergerSize::new::<6, 3>();
#[unsafe(no_mangle)]
pub static thetahat_rst_1: RstSize = RstSize::new::<1>();
#[unsafe(no_mangle)]
pub static thetahat_rst_2: RstSize = RstSize::new::<2>();
#[unsafe(no_mangle)]
pub static thetahat_rst_3: RstSize = RstSize::new::<3>();
#[unsafe(no_mangle)]
pub static thetahat_rst_4: RstSize = RstSize::new::<4>();
#[unsafe(no_mangle)]
pub static thetahat_rst_5: RstSize = RstSize::new::<5>();
#[unsafe(no_mangle)]
pub static thetahat_rst_6: RstSize = RstSize::new::<6>();
#[unsafe(no_mangle)]
pub static thetahat_rst_7: RstSize = RstSize::new::<7>();
#[unsafe(no_mangle)]
pub static thetahat_rst_8: RstSize = RstSize::new::<8>();
#[unsafe(no_mangle)]
pub static thetahat_rst_9: RstSize = RstSize::new::<9>();
#[unsafe(no_mangle)]
pub static thetahat_rst_10: RstSize = RstSize::new::<10>();
#[unsafe(no_mangle)]
pub static thetahat_rst_11: RstSize = RstSize::new::<11>();
#[unsafe(no_mangle)]
pub static thetahat_rst_12: RstSize = RstSize::new::<12>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_1: RstPlaceSize = RstPlaceSize::new::<1>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_2: RstPlaceSize = RstPlaceSize::new::<2>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_3: RstPlaceSize = RstPlaceSize::new::<3>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_4: RstPlaceSize = RstPlaceSize::new::<4>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_5: RstPlaceSize = RstPlaceSize::new::<5>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_6: RstPlaceSize = RstPlaceSize::new::<6>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_7: RstPlaceSize = RstPlaceSize::new::<7>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_8: RstPlaceSize = RstPlaceSize::new::<8>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_9: RstPlaceSize = RstPlaceSize::new::<9>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_10: RstPlaceSize = RstPlaceSize::new::<10>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_11: RstPlaceSize = RstPlaceSize::new::<11>();
#[unsafe(no_mangle)]
pub static thetahat_rst_place_12: RstPlaceSize = RstPlaceSize::new::<12>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_1_1: TunerSize = TunerSize::indirect::<1, 1, 3, 2>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_1_2: TunerSize = TunerSize::indirect::<1, 2, 4, 3>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_1_3: TunerSize = TunerSize::indirect::<1, 3, 5, 4>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_1_4: TunerSize = TunerSize::indirect::<1, 4, 6, 5>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_2_2: TunerSize = TunerSize::indirect::<2, 2, 5, 4>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_2_3: TunerSize = TunerSize::indirect::<2, 3, 6, 5>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_2_4: TunerSize = TunerSize::indirect::<2, 4, 7, 6>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_2_5: TunerSize = TunerSize::indirect::<2, 5, 8, 7>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_3_3: TunerSize = TunerSize::indirect::<3, 3, 7, 6>();
#[unsafe(no_mangle)]
pub static thetahat_indirect_3_4: TunerSize = TunerSize::indirect::<3, 4, 8, 7>();
#[unsafe(no_mangle)]
pub static thetahat_direct_1_1_1: TunerSize = TunerSize::direct::<1, 1, 1, 3, 1, 2>();
#[unsafe(no_mangle)]
pub static thetahat_direct_1_1_2: TunerSize = TunerSize::direct::<1, 1, 2, 4, 1, 4>();
#[unsafe(no_mangle)]
pub static thetahat_direct_1_1_3: TunerSize = TunerSize::direct::<1, 1, 3, 5, 2, 6>();
#[unsafe(no_mangle)]
pub static thetahat_direct_2_1_1: TunerSize = TunerSize::direct::<2, 1, 1, 4, 2, 2>();
#[unsafe(no_mangle)]
pub static thetahat_direct_2_2_1: TunerSize = TunerSize::direct::<2, 2, 1, 5, 2, 2>();
#[unsafe(no_mangle)]
pub static thetahat_direct_2_2_2: TunerSize = TunerSize::direct::<2, 2, 2, 6, 2, 4>();
#[unsafe(no_mangle)]
pub static thetahat_direct_2_2_3: TunerSize = TunerSize::direct::<2, 2, 3, 7, 3, 6>();
